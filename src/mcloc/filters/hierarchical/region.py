"""Regions of a kd-tree over states: a box, halved along axis depth mod k  [Est §3, Fig. 4]."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mcloc.geometry import wrap
from mcloc.statespace import States, StateSpace

OUTSIDE = -1
ROOT = 1  # the key of the root; the children of key k are 2 k and 2 k + 1


@dataclass(frozen=True, eq=False, slots=True)
class Region:
    """The states with low < x ≤ high along each axis. low, high: (D,), in the axes' units; on a
    circular axis an arc within [−π, π], all of it for the whole circle.
    """

    space: StateSpace
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    @property
    def sides(self) -> NDArray[np.float64]:
        """(D,): how long it is along each axis."""
        return self.high - self.low

    @property
    def centre(self) -> NDArray[np.float64]:
        """(D,)."""
        return 0.5 * (self.low + self.high)

    def widest(self) -> float:
        """Its longest side along the straight axes; along all if none is straight."""
        straight = ~np.array(self.space.circular)
        return float(self.sides[straight].max() if straight.any() else self.sides.max())

    def halves(self, axis: int) -> "tuple[Region, Region]":
        """x ≤ v and x > v, v being the middle along the axis."""
        first, second = self.high.copy(), self.low.copy()
        first[axis] = second[axis] = self.centre[axis]
        return Region(self.space, self.low, first), Region(self.space, second, self.high)

    def which_half(self, x: States, axis: int) -> NDArray[np.int8]:
        """(N,): 0 or 1, OUTSIDE for states that are in neither."""
        half = (x[axis] > self.centre[axis]).astype(np.int8)
        return np.where(self.holds(x), half, np.int8(OUTSIDE))

    def holds(self, x: States) -> NDArray[np.bool_]:
        """(N,): which states are in it."""
        inside: NDArray[np.bool_] = np.logical_and.reduce(self._within(x))
        return inside

    def beyond(self, x: States) -> NDArray[np.float64]:
        """(D, N): how far each state lies outside along each axis, < 0 below low; around circles
        the shorter way.
        """
        above, below = x - self.high[:, None], self.low[:, None] - x
        circular = np.array(self.space.circular)
        for way in (above, below):
            way[circular] %= 2.0 * np.pi
        upwards = np.where(circular[:, None], above < below, above > 0.0)
        return np.where(self._within(x), 0.0, np.where(upwards, above, -below))

    def collected(self, x: States, margin: NDArray[np.float64]) -> States:
        """(D, N): the same states, those farther outside than the margin (D,) brought back to it by
        as many margins as that takes: near the border, and as spread out as they were.
        """
        e = self.beyond(x)
        back = np.maximum(np.ceil(np.abs(e) / margin[:, None]) - 1.0, 0.0)
        states = x - np.sign(e) * back * margin[:, None]
        return wrapped(states, self.space)

    def _within(self, x: States) -> NDArray[np.bool_]:
        return (x > self.low[:, None]) & (x <= self.high[:, None])


def wrapped(x: States, space: StateSpace) -> States:
    """(D, N): the same states, angles in (−π, π]."""
    circular = np.array(space.circular)
    x[circular] = wrap(x[circular])
    return x


@lru_cache(maxsize=4096)
def region_of(whole: Region, key: int) -> Region:
    """The region of a node: halved once for each level above it."""
    if key == ROOT:
        return whole
    above = key >> 1
    axis = depth_of(above) % whole.space.dimension
    return region_of(whole, above).halves(axis)[key & 1]


def keys_of(whole: Region, x: States, depth: int) -> NDArray[np.int64]:
    """(N,): the node of a depth in whose region each state is, 0 for none."""
    low, high = np.tile(whole.low[:, None], x.shape[1]), np.tile(whole.high[:, None], x.shape[1])
    keys = np.where(whole.holds(x), ROOT, 0).astype(np.int64)
    for axis in (d % whole.space.dimension for d in range(depth)):
        middle = 0.5 * (low[axis] + high[axis])
        second = x[axis] > middle
        low[axis] = np.where(second, middle, low[axis])
        high[axis] = np.where(second, high[axis], middle)
        keys = 2 * keys + second * (keys > 0)
    return keys


def depth_of(key: int) -> int:
    """How many levels are above a node."""
    return key.bit_length() - 1
