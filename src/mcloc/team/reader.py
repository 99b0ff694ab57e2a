"""The bytes of a message, read from their beginning to their end, and never beyond it."""

import struct
from typing import Any

from mcloc.errors import MessageError
from mcloc.team.letters import check_name


class Reader:
    """What of a message has not been read yet. at: where that begins. Whatever it is asked for,
    it raises MessageError where the bytes cannot be that.
    """

    def __init__(self, data: bytes, at: int) -> None:
        self._data, self._at = data, at

    def values(self, of: struct.Struct) -> tuple[Any, ...]:
        """The next ones."""
        self._need(of.size)
        found = of.unpack_from(self._data, self._at)
        self._at += of.size
        return found

    def name(self) -> str:
        """The next one, of a robot."""
        self._need(1)
        n = self._data[self._at]
        self._at += 1
        self._need(n)
        text = self._data[self._at : self._at + n]
        self._at += n
        try:
            return check_name(text.decode())
        except UnicodeDecodeError as cause:
            raise MessageError("name that is not UTF-8") from cause

    def rest(self) -> bytes:
        """All that is left."""
        data, self._at = self._data[self._at :], len(self._data)
        return data

    def end(self) -> None:
        """Raises where there is more."""
        if self._at != len(self._data):
            raise MessageError("with more in it than belongs there")

    def _need(self, n: int) -> None:
        if self._at + n > len(self._data):
            raise MessageError("with less in it than belongs there")
