"""p(x_t | u_t, x_{t−1}) = N(x_t; R(θ)ᵀ (x_{t−1} − d), σ² I): how a thing that stands still moves in
the frame of a robot that drives d and turns θ  [Fox01 §19.3.1, the object in 3-D space].
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws, Stream
from mcloc.registry import Configurable, param
from mcloc.statespace import LogWeights, States


@dataclass(frozen=True)
class RelativeMotion(Configurable):
    """Motion model over R3: the place of an object ahead, left and up of a robot on a floor.

    u: (3,) the move since the last step in the robot's frame before it (m, m, rad). σ is that of
    the object's place along each axis: how far a wrong turn moves it would depend on where it is,
    which is left out.
    """

    sigma: float = param(0.02, "m", "deviation of each coordinate a step", low=1e-6, high=10)

    def sample(self, x: States, u: NDArray[np.float64], draws: Draws, first: int) -> States:
        """(3, n): x_t ~ p(x_t | u, x) for each column of x."""
        return carried(x, u) + self._noise(draws, first, x.shape[1])

    def sample_previous(
        self, x_new: States, u: NDArray[np.float64], draws: Draws, first: int
    ) -> States:
        """(3, n): x_{t−1} ~ p(x_new | u, x_{t−1}) / π(x_new | u): the noise and the move undone."""
        return carried_back(x_new - self._noise(draws, first, x_new.shape[1]), u)

    def log_density(self, x_new: States, u: NDArray[np.float64], x: States) -> LogWeights:
        """(n,): log p(x_new | u, x) per m³."""
        scaled = (x_new - carried(x, u)) / self.sigma
        norm = 3.0 * math.log(self.sigma * math.sqrt(2.0 * math.pi))
        density: LogWeights = -0.5 * (scaled**2).sum(axis=0) - norm
        return density

    def log_pi(self, x_new: States, u: NDArray[np.float64]) -> LogWeights:
        """(n,): 0. Moves of a rigid frame leave volumes alone, and noise is the same anywhere."""
        return np.zeros(x_new.shape[1])

    def doubted(self) -> Self:
        """Itself: there is no such model."""
        return self

    def _noise(self, draws: Draws, first: int, n: int) -> NDArray[np.float64]:
        noise: NDArray[np.float64] = self.sigma * draws.normal(Stream.MOTION, first, n)[:3]
        return noise


def carried(x: States, u: NDArray[np.float64]) -> States:
    """(3, n): where a thing at x is after the robot moved by u, R(θ)ᵀ (x − d)."""
    dx, dy, turned = (float(v) for v in u)
    cos, sin = math.cos(turned), math.sin(turned)
    ahead, left = x[0] - dx, x[1] - dy
    return np.stack([cos * ahead + sin * left, cos * left - sin * ahead, x[2]])


def carried_back(x_new: States, u: NDArray[np.float64]) -> States:
    """(3, n): where it was before, R(θ) x_new + d."""
    dx, dy, turned = (float(v) for v in u)
    cos, sin = math.cos(turned), math.sin(turned)
    ahead, left, up = x_new
    return np.stack([cos * ahead - sin * left + dx, sin * ahead + cos * left + dy, up])
