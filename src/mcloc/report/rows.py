"""A table of numbers that grows row by row, eight bytes a number: runs may last for hours."""

from array import array

import numpy as np
from numpy.typing import NDArray


class Rows:
    """Rows of `width` float64 each."""

    def __init__(self, width: int) -> None:
        self.width = width
        self._numbers = array("d")

    def __len__(self) -> int:
        return len(self._numbers) // self.width

    def add(self, *row: float) -> None:
        """Add a row."""
        assert len(row) == self.width
        self._numbers.extend(row)

    @property
    def last(self) -> tuple[float, ...]:
        """The last row."""
        return tuple(self._numbers[-self.width :])

    def drop_last(self) -> None:
        """Take the last row away."""
        del self._numbers[-self.width :]

    @property
    def table(self) -> NDArray[np.float64]:
        """(N, width): a copy of all rows."""
        return np.array(self._numbers, dtype=np.float64).reshape(-1, self.width)

    def extend(self, table: NDArray[np.float64]) -> None:
        """Add the rows of a table."""
        assert table.shape[1:] == (self.width,)
        self._numbers.frombytes(np.ascontiguousarray(table, dtype=np.float64).tobytes())
