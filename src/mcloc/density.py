"""Densities over states that particles are drawn from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws, Stream
from mcloc.geometry import wrap
from mcloc.statespace import LogWeights, States


@dataclass(frozen=True, eq=False)
class Gaussian:
    """The density around a given pose. mean: (3,). sigma: (3,) deviations in m, m, rad."""

    mean: NDArray[np.float64]
    sigma: NDArray[np.float64]

    def sample(self, draws: Draws, first: int, n: int) -> States:
        """(3, n): poses of the particles first … first + n − 1."""
        x = (
            self.mean[:, None]
            + self.sigma[:, None] * draws.normal(Stream.RANDOM_POSE, first, n)[:3]
        )
        x[2] = wrap(x[2])
        return x

    def log_density(self, x: States) -> LogWeights:
        """(n,): log density per m² rad, for deviations in θ that do not reach around the circle."""
        e = x - self.mean[:, None]
        e[2] = wrap(e[2])
        scaled = e / self.sigma[:, None]
        norm = float(np.log(self.sigma * np.sqrt(2.0 * np.pi)).sum())
        density: LogWeights = -0.5 * (scaled**2).sum(axis=0) - norm
        return density
