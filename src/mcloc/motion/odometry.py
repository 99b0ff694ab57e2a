"""p(x_t | u_t, x_{t−1}) from odometry: rotate δ_rot1, drive δ_trans, rotate δ_rot2, each with its
own noise  [Thrun, Burgard, Fox: Probabilistic Robotics, §5.4; Fox01 §19.2.2].
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcloc.kernels.moves import odometry_moves
from mcloc.motion.left_invariant import LARGEST, LeftInvariant, log_wrapped_normal
from mcloc.registry import param


@dataclass(frozen=True, slots=True)
class Decomposition:
    """u as rotate, drive, rotate, with the standard deviation of each. trans < 0 is driving
    backwards.
    """

    rot1: float
    trans: float
    rot2: float
    sd_rot1: float
    sd_trans: float
    sd_rot2: float


@dataclass(frozen=True)
class OdometryMotion(LeftInvariant):
    """Odometry motion model. u: (3,) the move since the last step in the robot's frame (m, m, rad).

    α₁ … α₄ are **standard deviations** per unit of motion, not variances; independent causes add in
    quadrature: σ_rot² = (α₁ δ_rot)² + (α₂ δ_trans)² + σ_min², σ_trans² = (α₃ δ_trans)² + (α₄
    (|δ_rot1| + |δ_rot2|))² + σ_min².
    """

    alpha1: float = param(0.15, "rad/rad", "turning error per turning", low=0, high=LARGEST)
    alpha2: float = param(0.05, "rad/m", "turning error per driving", low=0, high=LARGEST)
    alpha3: float = param(0.10, "m/m", "driving error per driving", low=0, high=LARGEST)
    alpha4: float = param(0.02, "m/rad", "driving error per turning", low=0, high=LARGEST)
    sigma_rot_min: float = param(0.01, "rad", "turning error of any move", above=0, high=LARGEST)
    sigma_trans_min: float = param(0.01, "m", "driving error of any move", above=0, high=LARGEST)

    def decompose(self, u: NDArray[np.float64]) -> Decomposition:
        """δ_rot1, δ_trans, δ_rot2 of a move, and their deviations.

        A robot that drives backwards turns by little, not by π; one that turns on the spot has no
        δ_rot1.
        """
        dx, dy, dtheta = (float(v) for v in u)
        trans, rot1 = math.hypot(dx, dy), math.atan2(dy, dx)
        if trans < self.sigma_trans_min:
            rot1 = 0.0
        elif abs(rot1) > math.pi / 2:
            trans, rot1 = -trans, rot1 - math.copysign(math.pi, rot1)
        rot2 = math.remainder(dtheta - rot1, 2.0 * math.pi)
        turned = abs(rot1) + abs(rot2)
        rot_min, drift = self.sigma_rot_min, self.alpha2 * trans
        return Decomposition(
            rot1,
            trans,
            rot2,
            math.hypot(self.alpha1 * rot1, drift, rot_min),
            math.hypot(self.alpha3 * trans, self.alpha4 * turned, self.sigma_trans_min),
            math.hypot(self.alpha1 * rot2, drift, rot_min),
        )

    def noise(self, u: NDArray[np.float64]) -> tuple[Any, tuple[float, ...]]:
        d = self.decompose(u)
        return odometry_moves, (d.rot1, d.trans, d.rot2, d.sd_rot1, d.sd_trans, d.sd_rot2)

    def log_density_of(
        self, move: NDArray[np.float64], u: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(n,): log f_u of each move.

        Two ways lead to a place: forwards, and backwards with δ_rot1 turned by π. Polar coordinates
        give the 1/δ_trans.
        """
        d = self.decompose(u)
        dx, dy, turned = move
        length = np.maximum(np.hypot(dx, dy), 1e-12)
        bearing = np.arctan2(dy, dx)
        ways = [
            log_wrapped_normal(rot1 - d.rot1, d.sd_rot1)
            + self.log_driven(trans, d.trans, d.sd_trans)
            + log_wrapped_normal(turned - rot1 - d.rot2, d.sd_rot2)
            for trans, rot1 in ((length, bearing), (-length, bearing + np.pi))
        ]
        density: NDArray[np.float64] = np.logaddexp(*ways) - np.log(length)
        return density
