"""p(z | x) = Π_k r(|z_k − x_k|) / Σ_g r(|g − x_k|): tile x has the grey value x, and is misread
[Est §2.1; §4, point 3].
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.environment import Tiles
from mcloc.registry import Configurable, param
from mcloc.statespace import LogWeights, States

Greys = NDArray[np.int64]
"""(D,): the grey value that was read on each of D channels, one for each axis."""

Chances = NDArray[np.float64]
"""(length, length): for each tile of a row, which is the matrix's row, a number for each value."""


@dataclass(frozen=True)
class GreySensor(Configurable, ABC):
    """A light sensor above tiles x (D, n), whole numbers 0 … shape[k] − 1 on axis k; D ≤ 4.

    It has a channel for each axis: on channel k the tile has the grey value x[k], and the values
    that can be read are those of the tiles. Channels err independently. What is no tile, and a
    value of none, has likelihood 0. Raises ConfigError for a shape that cannot be.
    """

    shape: tuple[int, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        Tiles(self.shape)

    @abstractmethod
    def r(self, distance: NDArray[np.float64]) -> NDArray[np.float64]:
        """How likely values are read that are so many tiles from the true one, up to a factor."""

    @cached_property
    def chances(self) -> tuple[Chances, ...]:
        """p(g | x) on each channel."""
        return tuple(self._chances(length) for length in self.shape)

    def log_likelihood(self, x: States, z: Greys) -> LogWeights:
        """(n,): log p(z | x) for each column of x."""
        with np.errstate(divide="ignore"):
            log_p: LogWeights = np.log(np.prod(_at(self.chances, x, z), axis=0))
        return log_p

    def readings(self, z: Greys) -> float:
        """1 for each channel."""
        return float(len(z))

    def beams(self, z: Greys) -> int:
        """1 for each channel."""
        return len(z)

    def source(self, z: Greys) -> str:
        """The only light sensor."""
        return "grey"

    def explained(self, x: States, z: Greys) -> NDArray[np.float64]:
        """(n,): the share of the channels whose value is at least half as likely at x as the
        likeliest one.
        """
        likely = [1.0 * (p >= 0.5 * p.max(axis=1, keepdims=True)) for p in self.chances]
        share: NDArray[np.float64] = np.mean(_at(likely, x, z), axis=0)
        return share

    def sample(self, x: NDArray[np.float64], rng: np.random.Generator) -> Greys:
        """(D,): what is read on a tile x (D,), for simulation."""
        rows = [p[int(i)] for p, i in zip(self.chances, x, strict=True)]
        return np.array([rng.choice(len(row), p=row) for row in rows], dtype=np.int64)

    def _chances(self, length: int) -> Chances:
        x = np.arange(float(length))
        r = self.r(np.abs(x - x[:, None]))
        p: Chances = r / r.sum(axis=1, keepdims=True)
        return p


@dataclass(frozen=True)
class GreyTile(GreySensor):
    """Misreading is the less likely the farther: r = 1 / (1 + |g − x|), so that any value can be
    read on any tile  [Est §2.1].
    """

    def r(self, distance: NDArray[np.float64]) -> NDArray[np.float64]:
        return 1.0 / (1.0 + distance)


@dataclass(frozen=True)
class PreciseGreyTile(GreySensor):
    """All values within an error of the true one are as likely, and no other can be read  [Est §4,
    point 3]. Near the ends of a row these are fewer.
    """

    error: int = param(1, "tile", "how far a value is off at most", low=0, high=1e6)

    def r(self, distance: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(distance <= self.error, 1.0, 0.0)


def _at(tables: Sequence[Chances], x: States, z: Greys) -> list[NDArray[np.float64]]:
    """For each channel (n,): the entry of its table for tile x and value z, 0 where either is
    none.
    """
    return [_entries(table, tile, value) for table, tile, value in zip(tables, x, z, strict=True)]


def _entries(table: Chances, x: NDArray[np.float64], value: np.int64) -> NDArray[np.float64]:
    """(n,): of one channel."""
    length = len(table)
    if not 0 <= value < length or value != int(value):
        return np.zeros(len(x))
    nearest = np.clip(x, 0.0, length - 1.0).astype(np.intp)
    return np.where(nearest == x, table[nearest, int(value)], 0.0)
