"""p(x_t | u_t, x_{t−1}) of a robot that can drive any way: δ_trans along the way it takes, noise
across it, and a rotation that has nothing to do with either  [nav2_amcl: OmniMotionModel].
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcloc.kernels.moves import omnidirectional_moves
from mcloc.motion.left_invariant import LARGEST, LeftInvariant, log_normal, log_wrapped_normal
from mcloc.registry import param


@dataclass(frozen=True, slots=True)
class Strafe:
    """u as a way in a direction, and a rotation; deviations along the way, across it (strafe), and
    of the rotation.
    """

    bearing: float
    trans: float
    rot: float
    sd_trans: float
    sd_strafe: float
    sd_rot: float


@dataclass(frozen=True)
class OmnidirectionalMotion(LeftInvariant):
    """Motion model of holonomic robots. u: (3,) the move since the last step in the robot's frame
    (m, m, rad).

    α₁ … α₅ are **standard deviations** per unit of motion, where nav2_amcl has variances;
    independent causes add in quadrature: σ_rot² = (α₁ δ_rot)² + (α₂ δ_trans)² + σ_min², σ_trans² =
    (α₃ δ_trans)² + (α₄ δ_rot)² + σ_min², σ_strafe² = (α₅ δ_trans)² + (α₄ δ_rot)² + σ_min².
    """

    alpha1: float = param(0.15, "rad/rad", "turning error per turning", low=0, high=LARGEST)
    alpha2: float = param(0.05, "rad/m", "turning error per driving", low=0, high=LARGEST)
    alpha3: float = param(0.10, "m/m", "error along the way per driving", low=0, high=LARGEST)
    alpha4: float = param(0.02, "m/rad", "error of the place per turning", low=0, high=LARGEST)
    alpha5: float = param(0.10, "m/m", "error across the way per driving", low=0, high=LARGEST)
    sigma_rot_min: float = param(0.01, "rad", "turning error of any move", above=0, high=LARGEST)
    sigma_trans_min: float = param(0.01, "m", "driving error of any move", above=0, high=LARGEST)

    def decompose(self, u: NDArray[np.float64]) -> Strafe:
        """Direction and length of a move, its rotation, and the three deviations.

        At rest there is no direction and none is needed: both deviations of the place are equal.
        """
        dx, dy, dtheta = (float(v) for v in u)
        trans = math.hypot(dx, dy)
        askew = self.alpha4 * dtheta
        return Strafe(
            math.atan2(dy, dx),
            trans,
            dtheta,
            math.hypot(self.alpha3 * trans, askew, self.sigma_trans_min),
            math.hypot(self.alpha5 * trans, askew, self.sigma_trans_min),
            math.hypot(self.alpha1 * dtheta, self.alpha2 * trans, self.sigma_rot_min),
        )

    def noise(self, u: NDArray[np.float64]) -> tuple[Any, tuple[float, ...]]:
        s = self.decompose(u)
        numbers = (s.bearing, s.trans, s.rot, s.sd_trans, s.sd_strafe, s.sd_rot)
        return omnidirectional_moves, numbers

    def log_density_of(
        self, move: NDArray[np.float64], u: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(n,): log f_u of each move: one factor along the way, one across it, one turning."""
        s = self.decompose(u)
        dx, dy, turned = move
        cos, sin = math.cos(s.bearing), math.sin(s.bearing)
        return (
            self.log_driven(cos * dx + sin * dy, s.trans, s.sd_trans)
            + log_normal(cos * dy - sin * dx, s.sd_strafe)
            + log_wrapped_normal(turned - s.rot, s.sd_rot)
        )
