"""p(x_t | u_t, x_{t−1}) = f_u(⊖x_{t−1} ⊕ x_t): the noise is in the move, wherever the robot is."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from mcloc.draws import Draws, Stream
from mcloc.geometry import wrap
from mcloc.kernels.jit import share
from mcloc.kernels.normals import room
from mcloc.registry import Configurable, param, parameters
from mcloc.statespace import LogWeights, States

LARGEST = 10.0  # of any deviation, in its own unit
_WRAPS = 2.0 * np.pi * np.arange(-2, 3)


@dataclass(frozen=True)
class LeftInvariant(Configurable, ABC):
    """A motion model that knows u (3,), the move since the last step in the robot's frame (m, m,
    rad), draws moves around it, and adds them to poses.

    Its parameters are p_reverse, loose and deviations. It knows no walls.
    """

    p_reverse: float = param(0.0, "", "chance that the robot drove the other way", low=0, high=0.5)
    loose: float = param(5.0, "", "factor on all deviations in the doubted model", low=1, high=100)

    @abstractmethod
    def noise(self, u: NDArray[np.float64]) -> tuple[Any, tuple[float, ...]]:
        """The kernel that draws and applies moves, and the six numbers that it takes: the parts of
        u, of which one can be driven the other way, and their deviations.
        """

    @abstractmethod
    def log_density_of(
        self, move: NDArray[np.float64], u: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(n,): log f_u per m² rad of each move, a column of (3, n) in the robot's frame."""

    def sample(self, x: States, u: NDArray[np.float64], draws: Draws, first: int) -> States:
        """(3, n): x_t ~ p(x_t | u, x) for each column of x."""
        return self._moved(0.0, x, u, draws, first)

    def sample_previous(
        self, x_new: States, u: NDArray[np.float64], draws: Draws, first: int
    ) -> States:
        """(3, n): x_{t−1} ~ p(x_new | u, x_{t−1}) / π(x_new | u): a move drawn and undone."""
        return self._moved(1.0, x_new, u, draws, first)

    def log_pi(self, x_new: States, u: NDArray[np.float64]) -> LogWeights:
        """(n,): 0. The density is a function of ⊖x ⊕ x_new alone, and SE(2) is unimodular."""
        return np.zeros(x_new.shape[1])

    def log_density(self, x_new: States, u: NDArray[np.float64], x: States) -> LogWeights:
        """(n,): log p(x_new | u, x) per m² rad."""
        dx, dy, turned = x_new - x
        cos, sin = np.cos(x[2]), np.sin(x[2])
        return self.log_density_of(np.stack([cos * dx + sin * dy, cos * dy - sin * dx, turned]), u)

    def doubted(self) -> Self:
        """The model for wheels that must have lied: they slipped, or count turns without seeing
        their direction.
        """
        deviations = {
            f.name: min(self.loose * getattr(self, f.name), f.metadata["high"])
            for f in parameters(self)
            if f.name not in ("p_reverse", "loose")
        }
        return replace(self, **deviations, p_reverse=0.5)

    def log_driven(
        self, driven: NDArray[np.float64], meant: float, sd: float
    ) -> NDArray[np.float64]:
        """Log density of a way that was meant, or with p_reverse its opposite."""
        density: NDArray[np.float64] = np.logaddexp.reduce(
            [
                math.log(p) + log_normal(driven - mean, sd)
                for mean, p in ((meant, 1.0 - self.p_reverse), (-meant, self.p_reverse))
                if p > 0.0
            ]
        )
        return density

    def _moved(
        self, back: float, x: States, u: NDArray[np.float64], draws: Draws, first: int
    ) -> States:
        move, numbers = self.noise(u)
        reverse_below = float(ndtri(self.p_reverse))
        counter = (first, int(Stream.MOTION), draws.step, draws.part, np.uint64(draws.seed))
        x, out = np.ascontiguousarray(x), np.empty(x.shape)

        def run(start: int, stop: int) -> None:
            move(x, out, numbers, reverse_below, back, counter, *room(), start, stop)

        share(run, x.shape[1], 8.0 * x.shape[1])
        return out


def log_normal(x: NDArray[np.float64], sd: float) -> NDArray[np.float64]:
    """Log of the normal density around 0."""
    return -0.5 * (x / sd) ** 2 - math.log(sd * math.sqrt(2.0 * math.pi))


def log_wrapped_normal(angle: NDArray[np.float64], sd: float) -> NDArray[np.float64]:
    """The normal density wrapped around the circle; two turns each way suffice for sd < 2 rad."""
    around = log_normal(wrap(angle)[:, None] + _WRAPS, sd)
    density: NDArray[np.float64] = np.logaddexp.reduce(around, axis=1)
    return density
