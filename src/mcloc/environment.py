"""Where a robot can stand, or an object can be: p(x | m), and U(x), poses spread evenly over free
cells and all headings, places over a box, or tiles.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws, Stream
from mcloc.errors import ConfigError, MapError
from mcloc.geometry import compose
from mcloc.maps.cell_table import CellTable
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.protocols import Environment
from mcloc.registry import Configurable, Registry, param
from mcloc.statespace import LogWeights, States

Corner = tuple[float, float, float]
MOST_AXES = 4  # of tiles: so many random numbers a particle has for each use


@dataclass(frozen=True)
class FreeSpace(Configurable):
    """A robot stands on free cells. As a density: uniform over free cells × (−π, π], per m² rad.

    p(x | m) is 1 on a free cell; maps err, so it is not 0 elsewhere. Raises MapError for a map
    without free cells.
    """

    grid: OccupancyGrid
    p_unknown: float = param(0.1, "", "p(x | m) on unknown cells and off the map", above=0, high=1)
    p_occupied: float = param(0.01, "", "p(x | m) inside walls", above=0, high=1)

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self._cells) == 0:
            raise MapError(
                f"{self.grid.name}: no free cell to stand on; check free_thresh and negate"
            )
        self.table  # noqa: B018 - ready before threads ask for it

    @cached_property
    def _cells(self) -> NDArray[np.int32]:
        return np.flatnonzero(self.grid.free).astype(np.int32)

    def sample(self, draws: Draws, first: int, n: int) -> States:
        """(3, n): poses of the particles first … first + n − 1, map frame."""
        u = draws.uniform(Stream.RANDOM_POSE, first, n)
        chosen = self._cells[
            np.minimum((u[0] * len(self._cells)).astype(np.intp), len(self._cells) - 1)
        ]
        row, column = np.divmod(chosen, self.grid.cells.shape[1])
        cell = self.grid.resolution
        heading = np.pi - 2.0 * np.pi * u[3]
        local = np.stack([(column + u[1]) * cell, (row + u[2]) * cell, heading], axis=-1)
        return np.ascontiguousarray(compose(self.grid.origin, local).T)

    def log_density(self, x: States) -> LogWeights:
        """(n,): −log(area · 2π) on free cells, −inf elsewhere."""
        row, column = self.grid.cell_of(x.T)
        height, width = self.grid.cells.shape
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        free = np.zeros(x.shape[1], dtype=np.bool_)
        free[inside] = self.grid.free[row[inside], column[inside]]
        area = len(self._cells) * self.grid.resolution**2
        return np.where(free, -np.log(area * 2.0 * np.pi), -np.inf)

    def log_prior(self, x: States) -> LogWeights:
        """(n,): log p(x | m)."""
        return self.table.at(x)

    @cached_property
    def table(self) -> CellTable:
        """log p(x | m) by cell."""
        values = np.log([1.0, self.p_unknown, self.p_occupied])
        which = np.where(self.grid.unknown, np.uint8(1), np.uint8(2))
        which[self.grid.free] = 0
        return CellTable.chosen(self.grid, values, np.pad(which, 1, constant_values=1))


@dataclass(frozen=True, slots=True)
class Box:
    """A box in space of volume V: p(x | m) = 1 and U(x) = 1 / V in it, 0 outside. low, high: its
    corners, metres, in the frame of the states.
    """

    low: Corner
    high: Corner

    def __post_init__(self) -> None:
        wide = [b - a for a, b in zip(self.low, self.high, strict=True)]
        if len(wide) != 3 or not all(0.0 < side < np.inf for side in wide):
            raise ConfigError(
                f"a box needs three finite sides > 0 m, got corners {self.low} and {self.high}"
            )

    @property
    def volume(self) -> float:
        """V, m³."""
        return float(np.prod(np.subtract(self.high, self.low)))

    def sample(self, draws: Draws, first: int, n: int) -> States:
        """(3, n): places of the particles first … first + n − 1."""
        u = draws.uniform(Stream.RANDOM_POSE, first, n)[:3]
        low, high = np.array(self.low)[:, None], np.array(self.high)[:, None]
        x: States = low + (high - low) * u
        return x

    def log_density(self, x: States) -> LogWeights:
        """(n,): −log V per m³ inside, −inf elsewhere."""
        density: LogWeights = self.log_prior(x) - np.log(self.volume)
        return density

    def log_prior(self, x: States) -> LogWeights:
        """(n,): 0 inside, −inf elsewhere."""
        low, high = np.array(self.low)[:, None], np.array(self.high)[:, None]
        inside = ((low <= x) & (x <= high)).all(axis=0)
        prior: LogWeights = np.where(inside, 0.0, -np.inf)
        return prior


@dataclass(frozen=True, slots=True)
class Tiles:
    """Tiles in a row, a rectangle, or along more axes: the whole numbers 0 … shape[k] − 1 on axis
    k. p(x | m) is 1 on each, U(x) = 1 / their number; both are 0 between and beyond them. Raises
    ConfigError for a shape that cannot be.
    """

    shape: tuple[int, ...]

    def __post_init__(self) -> None:
        whole = all(isinstance(length, (int, np.integer)) and length >= 1 for length in self.shape)
        if not (whole and 1 <= len(self.shape) <= MOST_AXES):
            raise ConfigError(
                f"tiles need 1 to {MOST_AXES} axes of at least 1 tile each, got shape {self.shape}"
            )

    def __len__(self) -> int:
        return math.prod(self.shape)

    def contain(self, x: States) -> NDArray[np.bool_]:
        """(n,): which columns of x (D, n) are tiles."""
        length = np.array(self.shape)[:, None]
        inside: NDArray[np.bool_] = ((x >= 0) & (x < length) & (x == np.floor(x))).all(axis=0)
        return inside

    def at(self, table: NDArray[np.float64], x: States) -> NDArray[np.float64]:
        """(n,): table[x] for each column of x (D, n), 0 where that is no tile. table: of shape
        `shape`.
        """
        inside = self.contain(x)
        found: NDArray[np.float64] = table[tuple(np.where(inside, x, 0.0).astype(np.intp))]
        return np.where(inside, found, 0.0)

    def sample(self, draws: Draws, first: int, n: int) -> States:
        """(D, n): tiles of the particles first … first + n − 1."""
        u = draws.uniform(Stream.RANDOM_POSE, first, n)[: len(self.shape)]
        return np.floor(np.array(self.shape)[:, None] * u)

    def log_density(self, x: States) -> LogWeights:
        """(n,): −log of their number on tiles, −inf elsewhere: a probability, not one per m."""
        return np.where(self.contain(x), -math.log(len(self)), -np.inf)

    def log_prior(self, x: States) -> LogWeights:
        """(n,): 0 on tiles, −inf elsewhere."""
        return np.where(self.contain(x), 0.0, -np.inf)


ENVIRONMENTS: Registry[Environment] = Registry("environment", {"free-space": FreeSpace})
