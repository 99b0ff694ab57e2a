"""q̄(x) = p(z | x) / π(z) of ranges to beacons: in the plane a place at distance d from a beacon has
density ∝ d p(r | d), which is what equal squares around it amount to,

    q̄(x) = Σ_s w_s [x ∈ s] / (A_s Δθ),  w_s ∝ A_s Π_k p(r_k | d_ks),

over squares s of the map and sectors Δθ of the circle, A_s the free area of a square  [Fox01 Eq.
19.3.7].
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws, Stream
from mcloc.environment import FreeSpace
from mcloc.errors import ConfigError
from mcloc.events import BeaconRanges
from mcloc.geometry import compose
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.particles import log_sum_exp
from mcloc.protocols import Environment
from mcloc.sensors.beacons import BeaconModel
from mcloc.statespace import LogWeights, States

SQUARE = 0.1  # m, in whole cells
MOST = 100_000  # squares; of larger maps they are wider
SECTORS = 8  # of headings: an antenna beside the robot's centre turns with it

Reals = NDArray[np.float64]
Whole = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class BeaconCircles:
    """Poses of a robot from ranges, under the filter's own likelihood.

    Several ranges meet where circles cross; one leaves the circle around its beacon, as far as a
    robot can stand on it. Since a range may be anything, q̄ is positive on all free cells.

    Raises ConfigError for an environment that is not made of free cells.
    """

    sensor: BeaconModel
    environment: Environment

    def __post_init__(self) -> None:
        if not isinstance(self.environment, FreeSpace):
            raise ConfigError(
                "poses from beacons need the free cells of a map; take environment free-space"
            )

    def given(self, z: BeaconRanges, draws: Draws) -> "CircleDensity":
        """q̄ for one measurement; nothing is drawn for it."""
        middle = self.squares.middle
        sectors = SECTORS if z.antenna[:2].any() else 1
        log_w = np.empty((sectors, middle.shape[1]))
        for k in range(sectors):
            heading = np.full(middle.shape[1], 2.0 * np.pi * k / sectors)
            log_w[k] = self.sensor.log_likelihood(np.stack([*middle, heading]), z)
        log_w += np.log(self.squares.number)
        total = log_sum_exp(log_w.ravel())
        return CircleDensity(self.squares, np.exp(log_w - total), total)

    @cached_property
    def squares(self) -> "Squares":
        """Those of the map that have free cells."""
        assert isinstance(self.environment, FreeSpace)
        grid = self.environment.grid
        wide = max(round(SQUARE / grid.resolution), 1)
        while (found := Squares.of(grid, wide)).middle.shape[1] > MOST:
            wide *= 2
        return found


class Squares(NamedTuple):
    """Squares of a map, and the free cells in them.

    wide: cells along a side. row, column: (C,) of all free cells, square by square. first, number:
    (S,) of each square's cells among these. of_block: (rows, columns) which square each block of
    the map is, −1 for none. middle: (2, S) of its free cells, metres, map frame.
    """

    grid: OccupancyGrid
    wide: int
    row: Whole
    column: Whole
    first: Whole
    number: Whole
    of_block: Whole
    middle: Reals

    @classmethod
    def of(cls, grid: OccupancyGrid, wide: int) -> "Squares":
        """The squares of `wide` cells that have a free one."""
        row, column = np.nonzero(grid.free)
        blocks = -(-np.array(grid.cells.shape) // wide)
        block = (row // wide) * blocks[1] + column // wide
        order = np.argsort(block, kind="stable")
        row, column = row[order], column[order]
        names, first, count = np.unique(block[order], return_index=True, return_counts=True)
        of_block = np.full(blocks.prod(), -1, dtype=np.intp)
        of_block[names] = np.arange(len(names))
        local = np.zeros((len(names), 3))
        for axis, at in enumerate((column, row)):
            sums = np.add.reduceat(at + 0.5, first)
            local[:, axis] = grid.resolution * sums / count
        middle = np.ascontiguousarray(compose(grid.origin, local).T[:2])
        return cls(grid, wide, row, column, first, count, of_block.reshape(blocks), middle)


@dataclass(frozen=True, eq=False)
class CircleDensity:
    """q̄ for one measurement. weights: (K, S) of the squares, for each sector of headings, the first
    around 0; their sum is 1. total: log of the sum of p over all their free cells.
    """

    squares: Squares
    weights: Reals
    total: float

    def __post_init__(self) -> None:
        self._cumulative  # noqa: B018 - ready before threads ask for it

    def sample(self, draws: Draws, first: int, n: int) -> States:
        """(3, n): poses of the particles first … first + n − 1, map frame."""
        grid, squares = self.squares.grid, self.squares
        u = draws.uniform(Stream.TREE, first, n)
        # One number chooses the square, and by what is left of it the cell.
        weights, reached = self.weights.ravel(), u[0] * self._cumulative[-1]
        at = np.searchsorted(self._cumulative, reached, side="right")
        at = np.minimum(at, weights.size - 1)
        left = (reached - self._cumulative[at]) / np.maximum(weights[at], 1e-300)
        sector, square = np.divmod(at, self.weights.shape[1])
        number = squares.number[square]
        nth = np.clip(((1.0 + left) * number).astype(np.intp), 0, number - 1)
        cell = squares.first[square] + nth
        heading = 2.0 * np.pi / len(self.weights) * (sector + 0.5 - u[3])
        local = np.stack(
            [
                (squares.column[cell] + u[1]) * grid.resolution,
                (squares.row[cell] + u[2]) * grid.resolution,
                heading - grid.origin[2],
            ],
            axis=-1,
        )
        return np.ascontiguousarray(compose(grid.origin, local).T)

    def log_density(self, x: States) -> LogWeights:
        """(n,): log q̄ at each column of x (3, n) per m² rad, −inf where nobody can stand."""
        grid = self.squares.grid
        row, column = grid.cell_of(x.T)
        height, width = grid.cells.shape
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        row, column = np.where(inside, row, 0), np.where(inside, column, 0)
        free = inside & grid.free[row, column]
        square = self.squares.of_block[row // self.squares.wide, column // self.squares.wide]
        sectors = len(self.weights)
        sector = np.rint(x[2] * sectors / (2.0 * np.pi)).astype(np.intp) % sectors
        with np.errstate(divide="ignore"):
            log_p = np.log(self.weights[sector, square] / self.squares.number[square])
        return np.where(free, log_p - self._log_cell, -np.inf)

    @property
    def log_pi(self) -> float:
        """log π(z), by the middles of the squares."""
        return self.total + self._log_cell

    @property
    def _log_cell(self) -> float:
        """Of a cell and a sector, log m² rad."""
        return math.log(self.squares.grid.resolution**2 * 2.0 * math.pi / len(self.weights))

    @cached_property
    def _cumulative(self) -> Reals:
        return np.cumsum(self.weights.ravel())
