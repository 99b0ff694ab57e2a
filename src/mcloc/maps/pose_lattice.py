"""A regular grid of poses over a map: cells of x and y in slices of θ."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.geometry import wrap
from mcloc.kernels.blur import SIDE
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.statespace import States


@dataclass(frozen=True, eq=False)
class PoseLattice:
    """The cells of a grid of poses, which are shifted slice by slice.

    cell: metres. slices: of θ, all around. The cells lie along the map's own axes, and reach a
    block of cells beyond it on all sides. They are stored row by row, slice by slice; where they
    lie is up to the offsets that each slice has been moved by, and up to how far all have turned.
    What is moved out on one side comes in on the other.
    """

    grid: OccupancyGrid
    cell: float
    slices: int

    @cached_property
    def shape(self) -> tuple[int, int, int]:
        """K, H, W: slices, rows, columns; the last two are whole blocks."""
        sides = np.array(self.grid.cells.shape) * self.grid.resolution / self.cell
        height, width = (SIDE * (2 + math.ceil(side / SIDE - 1e-9)) for side in sides)
        return self.slices, height, width

    @property
    def size(self) -> int:
        """Cells."""
        return math.prod(self.shape)

    @property
    def sides(self) -> NDArray[np.float64]:
        """(3,) of a cell: m, m, rad."""
        return np.array([self.cell, self.cell, 2.0 * np.pi / self.slices])

    @property
    def uniform(self) -> float:
        """The probability of each cell for a robot that may be anywhere in free space."""
        area = np.count_nonzero(self.grid.free) * self.grid.resolution**2
        return self.cell**2 / (area * self.slices)

    def headings(self, turn: float) -> NDArray[np.float64]:
        """(K,): θ in the map's own frame in the middle of each slice. turn: of all, radians."""
        middle: NDArray[np.float64] = turn + self.sides[2] * np.arange(self.slices)
        return middle

    def poses(self, cells: NDArray[np.intp], offsets: NDArray[np.float64], turn: float) -> States:
        """(3, n): the middles of cells (n,), indices into the grid as it is stored; map frame.

        offsets: (K, 2) of each slice along x and y, in cells.
        """
        _, height, width = self.shape
        rest, column = np.divmod(cells, width)
        k, row = np.divmod(rest, height)
        at = np.stack([column, row]) + 0.5
        size = np.array([[width], [height]], dtype=np.float64)
        at += np.take(offsets.T, k, axis=1)
        at -= size * np.floor(at / size)
        x, y = self.cell * (at - SIDE)
        # As `compose` does it, but each slice's angle is wrapped once.
        ox, oy, yaw = self.grid.origin
        cos, sin = np.cos(yaw), np.sin(yaw)
        return np.stack(
            [ox + cos * x - sin * y, oy + sin * x + cos * y, wrap(yaw + self.headings(turn))[k]]
        )

    def cells_of(self, x: States, offsets: NDArray[np.float64], turn: float) -> NDArray[np.intp]:
        """(n,): the cell that each pose x (3, n) lies in; −1 beyond all of them."""
        count, height, width = self.shape
        at = self.grid.to_grid(x.T).T / self.sides[:, None]
        k = np.mod(np.rint(at[2] - turn / self.sides[2]).astype(np.intp), count)
        at = at[:2] + SIDE
        size = np.array([[width], [height]])
        within = ((at >= 0.0) & (at < size)).all(axis=0)
        column, row = np.mod(np.floor(at - offsets[k].T).astype(np.intp), size)
        return np.where(within, (k * height + row) * width + column, -1)
