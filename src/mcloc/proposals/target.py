"""The one target of every proposal: p(z_t | x_t) ∫ p(x_t | u_t, x_{t−1}) Bel(x_{t−1}) dx_{t−1}
[Fox01 Eq. 19.2.3].
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from mcloc.draws import Draws, Stream
from mcloc.particles import Particles
from mcloc.protocols import Environment, Indices, MotionModel, SensorModel
from mcloc.statespace import States


@dataclass(frozen=True, eq=False)
class Target:
    """Everything that a step knows before it draws.

    The dynamics are p(x_t | u, x_{t−1}) = p(x_t | m) [(1 − α) ((1 − δ) p_d + δ p_doubted) + α
    U(x_t)]: random particles are part of the model, not a correction afterwards [Yee Eq. 1]; so are
    moves that the wheels did not report, and that a robot does not stand in walls [Probabilistic
    Robotics, §5.5]. uniform: whether nothing at all is known of the place yet. searching: whether
    the filter is not sure of it.
    """

    particles: Particles
    u: Any
    z: Any
    alpha: float
    doubt: float
    motion: MotionModel
    sensor: SensorModel
    environment: Environment
    uniform: bool = False
    searching: bool = False

    def sample_predictive(self, ancestors: Indices, draws: Draws, first: int) -> States:
        """(D, n): x_t from the dynamics but for p(x_t | m), the particles first … first + n − 1."""
        states = self.sample_moved(ancestors, draws, first)
        if self.alpha == 0.0:
            return states
        n = len(ancestors)
        random = draws.uniform(Stream.CHOICE, first, n)[0]
        return np.where(random < self.alpha, self.environment.sample(draws, first, n), states)

    def sample_moved(self, ancestors: Indices, draws: Draws, first: int) -> States:
        """(D, n): the same without random particles."""
        old = np.take(self.particles.states, ancestors, axis=1)
        states = self.motion.sample(old, self.u, draws, first)
        if self.doubt == 0.0:
            return states
        doubted = draws.uniform(Stream.CHOICE, first, len(ancestors))[1]
        loose = self.motion.doubted().sample(old, self.u, draws, first)
        return np.where(doubted < self.doubt, loose, states)
