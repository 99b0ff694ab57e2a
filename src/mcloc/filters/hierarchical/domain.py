"""What a hierarchy divides: all states there are, and states of a part of them."""

from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mcloc.environment import Tiles
from mcloc.filters.hierarchical.region import Region, wrapped
from mcloc.geometry import compose
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.protocols import Environment
from mcloc.statespace import SE2, States

TRIES = 16  # for a state where p(x | m) is 1
POINTS = 4096  # where it is asked how much of a region is free
MULTIPLIER = 48271.0
"""u times it, less the whole part, is as even as u is, and looks like chance  [Park, Miller,
Stockmeyer: CACM 36 (7), 1993], but for u = 0, which it leaves. Steps of equal length would lead
from walls to some places more than to others.
"""


class Domain(Protocol):
    """All states that there are, and U(x) over them."""

    @property
    def whole(self) -> Region:
        """The region of the root."""

    @property
    def environment(self) -> Environment:
        """p(x | m) and U(x)."""

    def states(self, region: Region, u: NDArray[np.float64]) -> States:
        """(D, N): states of a region, spread over it as u (D, N) is over the unit cube."""

    def amount(self, region: Region) -> float:
        """How much of all states is in a region: ∫ U(x) dx over it."""


@cache
def strides(dimension: int) -> NDArray[np.float64]:
    """(D, 1): whose multiples, less their whole parts, fill the unit cube evenly  [Roberts: The
    unreasonable effectiveness of quasirandom sequences, 2018].
    """
    root = 2.0  # of x^(D + 1) = x + 1
    for _ in range(64):
        root = (1.0 + root) ** (1.0 / (dimension + 1))
    found: NDArray[np.float64] = root ** -np.arange(1.0, dimension + 1.0)[:, None]
    return found


def evenly(n: int, dimension: int) -> NDArray[np.float64]:
    """(D, n): points that fill the unit cube evenly, without chance; on a line at equal
    distances.
    """
    if dimension == 1:
        return ((np.arange(n) + 0.5) / n)[None]
    return (0.5 + strides(dimension) * np.arange(n)) % 1.0


@dataclass(frozen=True, eq=False)
class Boxes:
    """Real states in a box, no matter of how many axes."""

    whole: Region
    environment: Environment

    @classmethod
    def of_map(cls, grid: OccupancyGrid, environment: Environment) -> "Boxes":
        """Poses on a map: the box around its free cells, and all headings."""
        rows, columns = np.nonzero(grid.free)
        corners = [
            (x, y) for x in (columns.min(), columns.max() + 1) for y in (rows.min(), rows.max() + 1)
        ]
        local = np.column_stack([np.array(corners) * grid.resolution, np.zeros(4)])
        x, y, _ = compose(grid.origin, local).T
        low, high = np.array([x.min(), y.min(), -np.pi]), np.array([x.max(), y.max(), np.pi])
        return cls(Region(SE2, low, high), environment)

    def states(self, region: Region, u: NDArray[np.float64]) -> States:
        """(D, N): where p(x | m) is less than 1 another place is tried, a few times."""
        low, sides = region.low[:, None], region.sides[:, None]
        states = wrapped(low + sides * u, region.space)
        poor = np.arange(u.shape[1])
        for _ in range(TRIES):
            still = self.environment.log_prior(np.take(states, poor, axis=1)) < 0.0
            poor, u = poor[still], u[:, still]
            if len(poor) == 0:
                break
            u = u * MULTIPLIER % 1.0
            states[:, poor] = wrapped(low + sides * u, region.space)
        return states

    def amount(self, region: Region) -> float:
        """Its volume times the mean of U(x) at points all over it."""
        u = evenly(POINTS, region.space.dimension)
        states = wrapped(region.low[:, None] + region.sides[:, None] * u, region.space)
        return float(region.sides.prod() * np.exp(self.environment.log_density(states)).mean())


@dataclass(frozen=True, eq=False)
class TileRows:
    """Tiles, the whole numbers from 0 along each axis."""

    whole: Region
    environment: Tiles

    def states(self, region: Region, u: NDArray[np.float64]) -> States:
        """(D, N): tiles; the next one up where there is none, the last one where there is none
        up.
        """
        first = np.minimum(np.floor(region.low) + 1.0, np.floor(self.whole.high))
        count = np.maximum(np.floor(region.high) - first + 1.0, 1.0)
        return first[:, None] + np.floor(u * count[:, None])

    def amount(self, region: Region) -> float:
        """Σ U(x) over its tiles."""
        first, count = np.floor(region.low) + 1.0, np.floor(region.high) - np.floor(region.low)
        shape = tuple(count.astype(int).tolist())
        tiles = first[:, None] + np.indices(shape).reshape(len(first), -1)
        return float(np.exp(self.environment.log_density(tiles)).sum())
