"""Text files line by line, gzip or not: every complaint names the file, the line and the fault."""

import gzip
import math
import os
import stat
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TextIO

from mcloc.errors import McLocError

GZIP_MAGIC = b"\x1f\x8b"
LONGEST_LINE = 1 << 20  # characters; a foreign file may be one line of gigabytes
HEAD = 1 << 16  # characters


@dataclass(frozen=True)
class TextFile:
    """The text file at `path`, gzip if it begins like one; its faults are raised as `error`."""

    path: str
    error: type[McLocError]

    def fault(self, line: int, what: str) -> McLocError:
        """The error to raise about one line (counted from 1)."""
        return self.error(f"{self.path}, line {line}: {what}")

    def lines(self) -> Iterator[tuple[int, str]]:
        """Numbers and lines from the first on, streaming.

        Raises the file's error at once where it cannot be opened, and in mid-stream where it is
        damaged: lines before the damage have been delivered.
        """
        number = 0
        with self._open() as stream:
            try:
                while line := stream.readline(LONGEST_LINE):
                    number += 1
                    if len(line) == LONGEST_LINE and not line.endswith("\n"):
                        raise self.fault(number, "too long for text; is this the right file?")
                    yield number, line
            except (OSError, EOFError, zlib.error) as cause:
                raise self.fault(number + 1, f"cut or damaged here ({cause})") from cause

    def head(self) -> list[str]:
        """The first lines, about 64 KiB of them: enough to tell what the file is.

        Damage behind a first line is left for `lines` to meet. Raises for a file that is missing,
        unreadable or empty.
        """
        head: list[str] = []
        size = 0
        try:
            for _, line in self.lines():
                head.append(line)
                size += len(line)
                if size >= HEAD:
                    break
        except self.error:
            if not head:
                raise
        if not head:
            raise self.error(f"{self.path}: the file is empty")
        return head

    def records(self, needed: Sequence[str]) -> Iterator[tuple[int, dict[str, str]]]:
        """Numbers and fields by name of the lines of a CSV file whose header names at least the
        `needed` ones; `#` begins a comment line. Raises the file's error for a line that lacks
        fields or has too many, and for a header that does.
        """
        names: list[str] = []
        for number, line in self.lines():
            fields = [field.strip() for field in line.split(",")]
            if line.isspace() or fields[0].startswith("#"):
                continue
            if not names:
                names = fields
                if missing := [name for name in needed if name not in names]:
                    raise self.fault(
                        number,
                        f"the header lacks {', '.join(missing)}; it must name {','.join(needed)}",
                    )
                continue
            if len(fields) != len(names):
                raise self.fault(number, f"{len(names)} fields expected, {len(fields)} found")
            yield number, dict(zip(names, fields, strict=True))
        if not names:
            raise self.error(f"{self.path}: the file is empty; it must name {','.join(needed)}")

    def number(self, line: int, name: str, field: str, below: float = math.inf) -> float:
        """A field as a finite number that is nearer to 0 than `below`. Raises the file's error."""
        try:
            value = float(field)
        except ValueError:
            value = math.nan
        if not abs(value) < below:
            limit = "" if math.isinf(below) else f" below {below:g}"
            raise self.fault(line, f"{name} must be a finite number{limit}, got {field!r}")
        return value

    def _open(self) -> TextIO:
        try:
            mode = os.stat(self.path).st_mode
            if not stat.S_ISREG(mode):  # opening a pipe could wait for ever
                kind = "a directory" if stat.S_ISDIR(mode) else "not a regular file"
                raise self.error(f"{self.path}: is {kind}; give the path of a file")
            with open(self.path, "rb") as raw:
                compressed = raw.read(len(GZIP_MAGIC)) == GZIP_MAGIC
            if compressed:
                return gzip.open(self.path, "rt", encoding="utf-8-sig", errors="replace")
            return open(self.path, encoding="utf-8-sig", errors="replace")
        except OSError as cause:
            raise self.error(f"{self.path}: cannot be opened ({cause.strerror})") from cause
        except ValueError as cause:  # a NUL in the path
            raise self.error(f"{self.path!r}: cannot be opened ({cause})") from cause
