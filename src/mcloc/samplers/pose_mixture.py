"""q̄(x) = ε U(x) + (1 − ε) Σ_i β_i N(x; μ_i, Λ): a Gaussian mixture over poses  [Yee Eq. 7]."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from mcloc.draws import Draws, Stream
from mcloc.geometry import Pose, compose, wrap
from mcloc.kernels.jit import share
from mcloc.kernels.pose_mixture import mixture_density
from mcloc.protocols import Environment
from mcloc.samplers.found_poses import chosen_from, log_pi_of, robot_at
from mcloc.statespace import LogWeights, States

CUT = 3.0  # deviations: farther from its mean a component has nothing
_EDGE = 1e-6  # deviations that the density goes beyond the samples: a pose is rounded
_WORK = 300.0  # ns a pose

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class Spread:
    """Λ: a Gaussian around a pose, isotropic in the plane, cut off at 3 deviations or where the
    circle ends.

    position: m, heading: rad, both > 0: the deviations before the cut.
    """

    position: float
    heading: float

    @property
    def cuts(self) -> tuple[float, float]:
        """Deviations from the mean from which on there is nothing: in the plane, and in heading."""
        return CUT, min(CUT, math.pi / self.heading)

    @property
    def volume(self) -> float:
        """∫ exp(−½ d²) over what is left, m² rad."""
        plane, heading = self.cuts
        disc = 2.0 * math.pi * self.position**2 * -math.expm1(-0.5 * plane**2)
        within = 2.0 * float(ndtr(heading)) - 1.0
        return disc * math.sqrt(2.0 * math.pi) * self.heading * within

    def around(self, mean: States, u: Reals) -> States:
        """(3, n): a pose around each mean (3, n), by inversion of u (3, n), from 0 to 1."""
        plane, heading = self.cuts
        r = self.position * np.sqrt(-2.0 * np.log1p(u[0] * math.expm1(-0.5 * plane**2)))
        least = float(ndtr(-heading))
        turn = self.heading * ndtri(least + u[2] * (1.0 - 2.0 * least))
        direction = 2.0 * np.pi * u[1]
        x, y = mean[0] + r * np.cos(direction), mean[1] + r * np.sin(direction)
        return np.stack([x, y, wrap(mean[2] + turn)])


@dataclass(frozen=True, eq=False)
class PoseMixture:
    """A robot whose sensor is around one of some poses, or which is anywhere in the environment.

    means: (3, M) poses of the sensor, map frame. weights: (M,) β, their sum is 1. Without any,
    q̄ = U. floor: ε. mount: (3,) of the sensor on the robot, whose pose has the density that the
    sensor's has: (x, y, θ) ↦ (x, y, θ) ⊕ mount is a turn of the plane for each θ. fit: log p(z | x)
    p(x | m) at each x (3, n). draws: for the estimate of π, from `looks` poses on; those of samples
    must be others.
    """

    means: States
    weights: Reals
    spread: Spread
    environment: Environment
    floor: float
    mount: Pose
    fit: Callable[[States], LogWeights]
    draws: Draws
    looks: int

    def __post_init__(self) -> None:
        self._chosen_from, self._rows  # noqa: B018 - ready before threads ask for them

    def sample(self, draws: Draws, first: int, n: int) -> States:
        """(3, n): the particles first … first + n − 1, map frame."""
        u = draws.uniform(Stream.TREE, first, n)
        x = self.environment.sample(draws, first, n)
        component = np.searchsorted(self._chosen_from, u[0], side="right") - 1
        here = np.flatnonzero(component >= 0)
        sensor = self.spread.around(self.means[:, component[here]], u[1:, here])
        x[:, here] = robot_at(sensor, self.mount)
        return x

    def log_density(self, x: States) -> LogWeights:
        """(n,): log q̄ at each column of x (3, n); −inf only where neither a component nor U has
        any.
        """
        density = self._uniform * np.exp(self.environment.log_density(x))
        if len(self.weights) > 0:
            density += (1.0 - self.floor) / self.spread.volume * self._sum(x)
        with np.errstate(divide="ignore"):
            log: LogWeights = np.log(density)
        return log

    @cached_property
    def log_pi(self) -> float:
        """log π, π = ∫ p(z | x) p(x | m) dx over the poses that q̄ has, as an importance sample of q̄
        gives it; worked out when it is first asked for.
        """
        return log_pi_of(self, self.fit, self.draws, self.looks)

    def _sum(self, x: States) -> Reals:
        """(n,): Σ β exp(−½ d²)."""
        sensor = np.ascontiguousarray(compose(x.T, self.mount).T)
        order, rows, starts, first_row = self._rows
        components = np.ascontiguousarray(self.means[:, order]), self.weights[order]
        deviations = self.spread.position, self.spread.heading
        limits = tuple(cut + _EDGE for cut in self.spread.cuts)
        out = np.empty(x.shape[1])

        def run(start: int, stop: int) -> None:
            table = sensor, rows, starts, first_row, *components
            mixture_density(*table, deviations, limits, out, start, stop)

        share(run, len(out), _WORK * len(out))
        return out

    @property
    def _uniform(self) -> float:
        return self.floor if len(self.weights) > 0 else 1.0

    @cached_property
    def _chosen_from(self) -> Reals:
        """(M,): as `chosen_from`."""
        return chosen_from(self.floor, self.weights)

    @cached_property
    def _rows(self) -> tuple[NDArray[np.intp], Reals, NDArray[np.intp], float]:
        """The components as kernels/pose_mixture wants them: their order; the rows that have some,
        where each begins, and y of row 0.
        """
        x, y, _ = self.means
        height = (CUT + _EDGE) * self.spread.position
        first_row = float(y.min()) if len(y) else 0.0
        row = np.floor((y - first_row) / height)
        order = np.lexsort((x, row))
        rows, starts = np.unique(row[order], return_index=True)
        return order, rows, np.append(starts, len(y)).astype(np.intp), first_row
