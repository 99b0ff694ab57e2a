"""p(x_t | u_t, x_{t−1}) of a robot that drives arcs: translational velocity v, rotational velocity
ω, and a last rotation γ̂ without which all poses would lie on a surface  [Thrun, Burgard, Fox:
Probabilistic Robotics, §5.3].
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcloc.geometry import wrap
from mcloc.kernels.moves import arc_moves
from mcloc.motion.left_invariant import (
    LARGEST,
    LeftInvariant,
    log_normal,
    log_wrapped_normal,
)
from mcloc.registry import param

_HALF_TURNS = np.arange(-2, 3)[:, None]


@dataclass(frozen=True, slots=True)
class Arc:
    """u as an arc that begins ahead, of length s = v Δt and turning by φ = ω Δt, and a last
    rotation γ, with the standard deviation of each. length < 0 is driving backwards.
    """

    length: float
    turn: float
    last: float
    sd_length: float
    sd_turn: float
    sd_last: float


@dataclass(frozen=True)
class VelocityMotion(LeftInvariant):
    """Velocity motion model. u: (3,) the move since the last step in the robot's frame (m, m, rad).

    Odometry gives s = v Δt and φ = ω Δt of the arc between two poses, and γ, what else the heading
    turned. α₁ … α₆ are **standard deviations** per unit of motion, not variances, in the book's
    order; so v̂ = v + ε with σ² = (α₁ v)² + (α₂ ω)², times Δt, is ŝ = s + ε with σ_s² = (α₁ s)² +
    (α₂ φ)²: Δt cancels. In the same way σ_φ² = (α₃ s)² + (α₄ φ)² and σ_γ² = (α₅ s)² + (α₆ φ)²; to
    each comes a σ_min². In the book γ̂ is noise alone; here it was measured, so that |φ| + |γ| is
    what was turned where the book has ω in σ_s and σ_γ.
    """

    alpha1: float = param(0.10, "m/m", "driving error per driving", low=0, high=LARGEST)
    alpha2: float = param(0.02, "m/rad", "driving error per turning", low=0, high=LARGEST)
    alpha3: float = param(0.05, "rad/m", "turning error per driving", low=0, high=LARGEST)
    alpha4: float = param(0.15, "rad/rad", "turning error per turning", low=0, high=LARGEST)
    alpha5: float = param(0.05, "rad/m", "last turn's error per driving", low=0, high=LARGEST)
    alpha6: float = param(0.05, "rad/rad", "last turn's error per turning", low=0, high=LARGEST)
    sigma_rot_min: float = param(0.01, "rad", "turning error of any move", above=0, high=LARGEST)
    sigma_trans_min: float = param(0.01, "m", "driving error of any move", above=0, high=LARGEST)

    def decompose(self, u: NDArray[np.float64]) -> Arc:
        """The arc from pose to pose [Table 5.1], its last rotation, and the deviations.

        A chord that leads off at φ/2 belongs to an arc that turns by φ, and is sin(φ/2) / (φ/2)
        times its length. What lies behind is reached backwards; one that turns on the spot has no
        γ.
        """
        dx, dy, dtheta = (float(v) for v in u)
        chord, half = math.hypot(dx, dy), math.atan2(dy, dx)
        if chord < self.sigma_trans_min:
            half = dtheta / 2.0
        elif abs(half) > np.pi / 2:
            chord, half = -chord, float(wrap(half + np.pi))
        length, turn = chord / float(np.sinc(half / np.pi)), 2.0 * half
        last = float(wrap(dtheta - turn))
        turned = abs(turn) + abs(last)
        return Arc(
            length,
            turn,
            last,
            math.hypot(self.alpha1 * length, self.alpha2 * turned, self.sigma_trans_min),
            math.hypot(self.alpha3 * length, self.alpha4 * turn, self.sigma_rot_min),
            math.hypot(self.alpha5 * length, self.alpha6 * turned, self.sigma_rot_min),
        )

    def noise(self, u: NDArray[np.float64]) -> tuple[Any, tuple[float, ...]]:
        a = self.decompose(u)
        return arc_moves, (a.length, a.turn, a.last, a.sd_length, a.sd_turn, a.sd_last)

    def log_density_of(
        self, move: NDArray[np.float64], u: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(n,): log f_u of each move.

        Many arcs lead to a place: each half turn more of φ/2 = h reaches it the other way round.
        With s = c h / sin h for a chord c, the Jacobian |∂(x, y)/∂(s, φ)| is |c sin h / (2 h)|. Two
        half turns more and less suffice for sd_turn < 3 rad.
        """
        a = self.decompose(u)
        dx, dy, turned = move
        chord = np.maximum(np.hypot(dx, dy), 1e-12)
        bearing = np.arctan2(dy, dx)
        backwards = np.abs(bearing) > np.pi / 2
        half = np.where(backwards, wrap(bearing + np.pi), bearing) + np.pi * _HALF_TURNS
        signed = np.where(backwards, -chord, chord) * (1.0 - 2.0 * (np.abs(_HALF_TURNS) % 2))
        shrink = np.sinc(half / np.pi)
        last = (turned - 2.0 * half - a.last).ravel()
        ways = (
            self.log_driven(signed / shrink, a.length, a.sd_length)
            + log_normal(2.0 * half - a.turn, a.sd_turn)
            + log_wrapped_normal(last, a.sd_last).reshape(half.shape)
            - np.log(0.5 * chord * np.abs(shrink))
        )
        density: NDArray[np.float64] = np.logaddexp.reduce(ways, axis=0)
        return density
