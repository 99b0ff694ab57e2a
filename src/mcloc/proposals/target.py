"""The one target of every proposal: p(z_t | x_t) ∫ p(x_t | u_t, x_{t−1}) Bel(x_{t−1}) dx_{t−1}  [Fox01 Eq. 19.2.3]."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from mcloc.draws import Draws, Stream
from mcloc.particles import Particles
from mcloc.protocols import Density, Indices, MotionModel, SensorModel
from mcloc.statespace import LogWeights, States


@dataclass(frozen=True, eq=False)
class Target:
    """Everything that a step knows before it draws.

    The dynamics are p(x_t | u, x_{t−1}) = (1 − α) p_d(x_t | u, x_{t−1}) + α U(x_t)  [Yee Eq. 1]: random particles are part of the model,
    not a correction afterwards.
    """

    particles: Particles
    u: Any
    z: Any
    alpha: float
    motion: MotionModel
    sensor: SensorModel
    uniform: Density

    def sample_predictive(self, ancestors: Indices, draws: Draws, first: int) -> States:
        """(D, n): x_t ~ p(x_t | u, x_{t−1}^(ancestor)), the particles first … first + n − 1."""
        n = len(ancestors)
        states = self.motion.sample(self.particles.states[:, ancestors], self.u, draws, first)
        if self.alpha > 0.0:
            random = draws.uniform(Stream.RANDOM_CHOICE, first, n)[0] < self.alpha
            states = np.where(random, self.uniform.sample(draws, first, n), states)
        return states

    def log_likelihood(self, x: States) -> LogWeights:
        """(n,): log p(z | x)."""
        return self.sensor.log_likelihood(x, self.z)
