"""p(x_t | u_t, x_{t−1}) = 1 / (π (v u_t)²) where |x_t − x_{t−1}| ≤ v u_t, else 0: a robot may be
anywhere that its speed v lets it reach in the time u_t  [Estivill-Castro, McKenzie: Hierarchical
Monte-Carlo localisation, Fig. 1, step 2: the max distance model of Gutmann, Fox: IROS 2002].
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from mcloc.draws import Draws, Stream
from mcloc.errors import ConfigError
from mcloc.geometry import wrap
from mcloc.registry import Configurable, param
from mcloc.statespace import LogWeights, States

EDGE = 1e-6  # share of its reach that the density goes beyond the samples: they are rounded


@dataclass(frozen=True)
class MaxDistanceMotion(Configurable):
    """Motion model of a robot without odometry, over places (2, n) or poses (3, n), map frame.

    u: seconds since the last step, ≥ 0; ConfigError for anything else. The place is uniform over
    the disc of radius speed · u around the old one; a heading is uniform within turn_rate · u of
    the old one, all around the circle from half a turn on. After 0 s the robot is where it was. It
    knows no walls.
    """

    speed: float = param(0.3, "m/s", "as fast as the robot moves", above=0, high=100)
    turn_rate: float = param(1.5, "rad/s", "as fast as it turns", above=0, high=100)

    def reach(self, u: float) -> tuple[float, float]:
        """How far (m) a robot gets in u seconds, and how far (rad, π at most) it turns."""
        if not 0.0 <= u < math.inf:
            raise ConfigError(
                f"MaxDistanceMotion: u must be the seconds since the last step, finite and >= 0, "
                f"got {u}"
            )
        return self.speed * u, min(math.pi, self.turn_rate * u)

    def sample(self, x: States, u: float, draws: Draws, first: int) -> States:
        """(D, n): x_t ~ p(x_t | u, x) for each column of x."""
        far, turn = self.reach(u)
        chance = draws.uniform(Stream.MOTION, first, x.shape[1])
        r, direction = far * np.sqrt(chance[0]), 2.0 * np.pi * chance[1]
        x_new = np.array(x, dtype=np.float64)
        x_new[0] += r * np.cos(direction)
        x_new[1] += r * np.sin(direction)
        if len(x) == 3:
            x_new[2] = wrap(x[2] + turn * (2.0 * chance[2] - 1.0))
        return x_new

    def sample_previous(self, x_new: States, u: float, draws: Draws, first: int) -> States:
        """(D, n): x_{t−1} ~ p(x_new | u, x_{t−1}) / π(x_new | u). As far as from x_{t−1} to x_new
        it is back: the same as `sample`.
        """
        return self.sample(x_new, u, draws, first)

    def log_density(self, x_new: States, u: float, x: States) -> LogWeights:
        """(n,): log p(x_new | u, x) per m², or per m² rad. Raises ConfigError for u = 0, when all
        is in one point and no density says so.
        """
        far, turn = self.reach(u)
        if far == 0.0:
            raise ConfigError(
                "MaxDistanceMotion: after u = 0 s the robot is where it was, which has no density; "
                "leave the step out"
            )
        apart = x_new - x
        near = np.hypot(apart[0], apart[1]) <= far * (1.0 + EDGE)
        log_p = -math.log(math.pi) - 2.0 * math.log(far)
        if len(x) == 3:
            near &= np.abs(wrap(apart[2])) <= turn * (1.0 + EDGE)
            log_p -= math.log(2.0 * turn)
        return np.where(near, log_p, -np.inf)

    def log_pi(self, x_new: States, u: float) -> LogWeights:
        """(n,): 0. In the plane, without walls, as many places lead to x_new as it leads to."""
        return np.zeros(x_new.shape[1])

    def doubted(self) -> Self:
        """Itself: it asks no wheels."""
        return self
