"""Boxes of poses: squares of a map times parts of the circle, halved along all axes at each
level.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.geometry import compose
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.statespace import States

Keys = NDArray[np.int64]
"""Shape (n,): which box of a level each is; −1 for none."""

PARTS = 8  # of a box, at the next level
_AT_ONCE = 1 << 14  # squares
HALVES = np.indices((2, 2, 2)).reshape(3, 1, PARTS)


@dataclass(frozen=True, eq=False)
class PoseBoxes:
    """The boxes of a map, which fill it without overlapping, at every level.

    cells: along the sides of the squares of level 0, the first of which begins at the map's corner;
    they lie along the map's own axes. headings: parts of the circle at level 0, the first of which
    lies around the map's own x axis, half on either side.
    """

    grid: OccupancyGrid
    cells: int
    headings: int

    def free_squares(self) -> tuple[Keys, States]:
        """Squares of level 0 that have a free cell, row by row; and the middle of the free cell of
        each that is nearest to the square's middle, (3, n) in the map frame, heading along the
        map's own x axis.
        """
        blocks = self._blocks()
        columns = blocks.shape[2]
        squares = np.flatnonzero(blocks.any(axis=(1, 3)))
        off = (np.arange(self.cells) - 0.5 * (self.cells - 1)) ** 2
        far = np.add.outer(off, off)
        chosen = np.empty(len(squares), dtype=np.intp)
        for at in range(0, len(squares), _AT_ONCE):
            some = squares[at : at + _AT_ONCE]
            free = blocks[some // columns, :, some % columns]
            chosen[at : at + _AT_ONCE] = (
                np.where(free, far, np.inf).reshape(len(some), -1).argmin(axis=1)
            )
        corner = self.cells * np.stack(np.divmod(squares, columns))
        row, column = corner + np.stack(np.divmod(chosen, self.cells)) + 0.5
        local = self.grid.resolution * np.stack([column, row, np.zeros(len(squares))], axis=-1)
        return squares, np.ascontiguousarray(compose(self.grid.origin, local).T)

    def free_keys(self) -> Keys:
        """The boxes of level 0 that have a free cell, sorted."""
        squares = np.flatnonzero(self._blocks().any(axis=(1, 3)))
        return (squares[:, None] * self.headings + np.arange(self.headings)).ravel()

    def count_free_squares(self) -> int:
        """How many squares of level 0 have a free cell."""
        return int(np.count_nonzero(self._blocks().any(axis=(1, 3))))

    def _blocks(self) -> NDArray[np.bool_]:
        """(rows, cells, columns, cells): which cells are free, by square of level 0."""
        _, rows, columns = self.shape(0)
        height, width = self.grid.cells.shape
        beyond = (0, rows * self.cells - height), (0, columns * self.cells - width)
        return np.pad(self.grid.free, beyond).reshape(rows, self.cells, columns, self.cells)

    def sides(self, level: int) -> NDArray[np.float64]:
        """(3,): m, m, rad."""
        side = self.cells * self.grid.resolution
        return np.array([side, side, 2.0 * np.pi / self.headings]) / 2.0**level

    def around(self, x: States, level: int) -> Keys:
        """The box that each pose x (3, n) of the map frame lies in, −1 off the map."""
        headings, rows, columns = self.shape(level)
        at = self.grid.to_grid(x.T).T / self.sides(level)[:, None]
        at[2] += _before(level)
        column, row, heading = np.floor(at).astype(np.int64)
        on = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return np.where(on, (row * columns + column) * headings + heading % headings, -1)

    def poses(self, keys: Keys, level: int, u: NDArray[np.float64]) -> States:
        """(3, n): a pose in each box, map frame; u (3, n), from 0 to 1, says where in it along x, y
        and θ of the map's own frame.
        """
        at = self.indices(keys, level) + u
        at[2] -= _before(level)
        return np.ascontiguousarray(
            compose(self.grid.origin, (at * self.sides(level)[:, None]).T).T
        )

    def parts(self, keys: Keys, level: int) -> Keys:
        """(8 n,): the parts of each box, which are of the next level, sorted."""
        headings, _, columns = self.shape(level + 1)
        column, row, heading = 2 * self.indices(keys, level)[:, :, None] + HALVES
        return np.sort((row * columns + column) * headings + heading, axis=None)

    def parents(self, keys: Keys, level: int) -> Keys:
        """(n,): the box of the level above that each box of a level > 0 is a part of."""
        headings, _, columns = self.shape(level - 1)
        column, row, heading = self.indices(keys, level) // 2
        above: Keys = (row * columns + column) * headings + heading
        return above

    def indices(self, keys: Keys, level: int) -> NDArray[np.int64]:
        """(3, n): column, row and heading."""
        headings, _, columns = self.shape(level)
        place, heading = np.divmod(keys, headings)
        row, column = np.divmod(place, columns)
        return np.stack([column, row, heading])

    def shape(self, level: int) -> tuple[int, int, int]:
        """How many headings, rows and columns."""
        height, width = self.grid.cells.shape
        rows, columns = -(-height // self.cells), -(-width // self.cells)
        return self.headings << level, rows << level, columns << level


def _before(level: int) -> float:
    """How many parts of the circle lie before the map's own x axis."""
    return 0.5 * 2.0**level
