"""p(x) = (1 − ε) · weight of the leaf around x / its volume + ε / volume of the root: a weighted
sample set as a density, constant in each leaf of a kd-tree  [Fox01 §19.3.2, §19.4.1].
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.draws import Draws, Stream
from mcloc.errors import ConfigError, FilterError
from mcloc.geometry import wrap
from mcloc.kernels.density_tree import grow, look_up, to_unit_cube
from mcloc.kernels.jit import share
from mcloc.particles import Particles
from mcloc.statespace import LogWeights, States, StateSpace

FLOOR = 0.01
LEAST_SIDE = 1e-3  # m or rad: finer than a robot is localized

_WORK = 40  # ns for a point to go down the tree


def leaf_size(n: int, dimension: int) -> int:
    """Most samples that a leaf should hold: ⌈½ n^(2/(D+2))⌉.

    With leaves of side h the density is wrong by a bias of order h and a deviation of order
    (n h^D)^(−1/2). They balance where h ~ n^(−1/(D+2)), which leaves n h^D ~ n^(2/(D+2)) samples
    for a leaf, and the error falls as n^(−1/(D+2)), not as n^(−1/2). Of ¼, ½, 1 and 2 the factor ½
    was measured to be the best or within 7 % of it, for one and for several hills of places on a
    line and of poses in the plane, n from 10³ to 10⁵.
    """
    return int(np.ceil(0.5 * n ** (2.0 / (dimension + 2))))


@dataclass(frozen=True, eq=False)
class DensityTree:
    """A density over a state space; make one with `fit`.

    floor: ε. low, side (D,): the root box, outside of which the density is 0; on a circular axis it
    is the whole circle, cut at low. axis, split, child (K,), corner, width (K, D): nodes and their
    boxes in the unit cube that the root is scaled to, as the kernel `grow` makes them. weight (K,):
    that of the samples in each leaf, 0 at other nodes; the sum is 1.
    """

    space: StateSpace
    floor: float
    low: NDArray[np.float64]
    side: NDArray[np.float64]
    axis: NDArray[np.uint64]
    split: NDArray[np.float64]
    child: NDArray[np.uint64]
    corner: NDArray[np.float64]
    width: NDArray[np.float64]
    weight: NDArray[np.float64]

    @classmethod
    def fit(
        cls,
        particles: Particles,
        space: StateSpace,
        floor: float = FLOOR,
        leaf: int | None = None,
        least_side: float = LEAST_SIDE,
    ) -> "DensityTree":
        """The density that particles are samples of.

        floor: ε in [0, 1), the share of a uniform density over the root box; it bounds importance
        weights within it. leaf: most samples of a leaf, `leaf_size` where None. least_side: no box
        is halved to sides below it, in units of the axes; a root of less extent, of a single
        particle or many identical ones, is given it.

        Raises FilterError on a state or weight that is NaN or infinite, where every weight is 0, or
        for states of another space.
        """
        states = np.ascontiguousarray(particles.states, dtype=np.float64)
        n, d = len(particles), space.dimension
        if len(states) != d or n == 0 or not np.isfinite(states).all():
            raise FilterError(f"a density tree needs finite states of {d} axes, at least one")
        leaf = leaf_size(n, d) if leaf is None else int(leaf)
        if not (0.0 <= floor < 1.0 and leaf >= 1 and 0.0 < least_side < np.inf):
            raise ConfigError(
                "a density tree takes 0 <= floor < 1, leaf >= 1 and least_side > 0, "
                f"got {floor}, {leaf} and {least_side}"
            )
        if not np.isfinite(particles.log_weights.max()):  # NaN wherever there is one
            raise FilterError("a density tree needs weights that are not NaN and not all 0")
        weights = particles.weights
        low, side = _root(states, weights, np.array(space.circular), least_side)
        unit = _to_unit_cube(states, low, side, np.array(space.circular))
        return cls(space, floor, low, side, *_grown(unit, weights, leaf, least_side / side))

    @cached_property
    def mass(self) -> NDArray[np.float64]:
        """(K,): the probability of each leaf, 0 at other nodes; the sum is 1."""
        leaves = self.child == np.arange(len(self.child), dtype=np.uint64)
        mass = (1.0 - self.floor) * self.weight + self.floor * self.width.prod(axis=1)
        found: NDArray[np.float64] = np.where(leaves, mass, 0.0)
        return found

    @cached_property
    def log_values(self) -> NDArray[np.float64]:
        """(K,): the log density in each leaf, per unit of volume of the space."""
        with np.errstate(divide="ignore"):
            values: NDArray[np.float64] = np.log(self.mass / self.width.prod(axis=1))
        values -= np.log(self.side).sum()
        return values

    def log_density(self, x: ArrayLike) -> LogWeights:
        """(n,): log density at each column of x (D, n), −inf outside the root box. Raises
        FilterError on NaN and on an infinite angle.
        """
        states = np.ascontiguousarray(x, dtype=np.float64)
        if states.ndim != 2 or len(states) != self.space.dimension:
            raise FilterError(
                f"states must be ({self.space.dimension}, n), got shape {states.shape}"
            )
        unit = _to_unit_cube(states, self.low, self.side, np.array(self.space.circular))
        out = np.empty(states.shape[1])
        tree = self.axis, self.split, self.child, self.log_values
        share(lambda a, b: look_up(unit, *tree, out, a, b), len(out), _WORK * len(out))
        if np.isnan(out).any():
            raise FilterError("a state is NaN, or an angle infinite")
        return out

    def sample(self, draws: Draws, first: int, n: int) -> States:
        """(D, n): the particles first … first + n − 1, each from a leaf by its mass and anywhere in
        it.
        """
        d = self.space.dimension
        words = d // 4 + 1  # blocks of four uniforms for each particle
        drawn = draws.uniform(Stream.TREE, first * words, n * words).reshape(4, n, words)
        u = drawn.transpose(2, 0, 1).reshape(4 * words, n)[: d + 1]
        cumulative = np.cumsum(self.mass)
        leaf = np.searchsorted(cumulative, u[0] * cumulative[-1], side="right")
        x: States = np.ascontiguousarray(self.corner[leaf].T + u[1:] * self.width[leaf].T)
        x *= self.side[:, None]
        x += self.low[:, None]
        circular = np.array(self.space.circular)
        x[circular] = wrap(x[circular])
        return x


def _root(
    states: States,
    weights: NDArray[np.float64],
    circular: NDArray[np.bool_],
    least_side: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Low corner and sides (D,) of the root box.

    A circular axis has its whole circle, cut opposite to the mean. On another the bounding box is
    grown at either end by its 1/(N − 1), as far as N uniform samples stay away from the ends of
    what they are drawn from.
    """
    lowest, highest = states.min(axis=1), states.max(axis=1)
    gap = (highest - lowest) / max(states.shape[1] - 1, 1)
    side = np.maximum(highest - lowest + 2.0 * gap, least_side)
    low = 0.5 * (lowest + highest) - 0.5 * side
    for d in np.flatnonzero(circular):
        east, north = (weights * np.cos(states[d])).sum(), (weights * np.sin(states[d])).sum()
        low[d], side[d] = np.arctan2(north, east) - np.pi, 2.0 * np.pi
    return low, side


def _to_unit_cube(
    states: States,
    low: NDArray[np.float64],
    side: NDArray[np.float64],
    circular: NDArray[np.bool_],
) -> States:
    """(D, n): coordinates within the root box, 0 … 1 inside."""
    unit = np.empty_like(states)
    n = states.shape[1]
    share(lambda a, b: to_unit_cube(states, low, side, circular, unit, a, b), n, unit.size)
    return unit


def _grown(
    unit: States, weights: NDArray[np.float64], leaf: int, least: NDArray[np.float64]
) -> tuple[Any, ...]:
    """axis, split, child, corner, width, weight of the nodes."""
    d, n = unit.shape
    room = 8 * n // leaf + 256  # samples on far-off hills take more, halved many times on the way
    while True:
        order, first = np.arange(n, dtype=np.uint64), np.empty((room, 2), dtype=np.int64)
        axis, child = np.empty((2, room), dtype=np.uint64)
        split, weight = np.empty((2, room))
        corner, width = np.empty((2, room, d))
        found = axis, split, child, corner, width, weight
        nodes = grow(unit, weights, leaf, least, order, first, *found)
        if nodes >= 0:
            return tuple(array[:nodes].copy() for array in found)
        room *= 2
