"""A few items of a stream of unknown length, evenly spread over it: when there are too many, every
other one goes, and from then on half as many come.
"""

from collections.abc import Iterator
from typing import Generic, TypeVar

T = TypeVar("T")


class Thinned(Generic[T]):
    """At most `most` (> 1) items, and at least half as many of a stream that has them."""

    def __init__(self, most: int) -> None:
        self.most = most
        self.seen = 0
        self._every = 1
        self._kept: list[T] = []

    def add(self, item: T) -> None:
        """The next item of the stream."""
        if self.seen % self._every == 0:
            self._kept.append(item)
            if len(self._kept) > self.most:
                self._kept = self._kept[::2]
                self._every *= 2
        self.seen += 1

    def __iter__(self) -> Iterator[T]:
        return iter(self._kept)

    def __len__(self) -> int:
        return len(self._kept)
