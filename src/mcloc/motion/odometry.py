"""p(x_t | u_t, x_{t−1}) from odometry: rotate δ_rot1, drive δ_trans, rotate δ_rot2, each with its
own noise  [Thrun, Burgard, Fox: Probabilistic Robotics, §5.4; Fox01 §19.2.2].
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from mcloc.draws import Draws, Stream
from mcloc.geometry import wrap
from mcloc.kernels.jit import share
from mcloc.kernels.odometry import apply_moves, sample_moves, undo_moves
from mcloc.registry import Configurable, param
from mcloc.statespace import LogWeights, States

LARGEST = 10.0  # of any deviation, in its own unit
_WRAPS = 2.0 * np.pi * np.arange(-2, 3)


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
class OdometryMotion(Configurable):
    """Odometry motion model. u: (3,) the move since the last step in the robot's frame (m, m, rad).

    α₁ … α₄ are **standard deviations** per unit of motion, not variances; independent causes add in
    quadrature: σ_rot² = (α₁ δ_rot)² + (α₂ δ_trans)² + σ_min², σ_trans² = (α₃ δ_trans)² + (α₄
    (|δ_rot1| + |δ_rot2|))² + σ_min². The noise does not know walls and depends on the relative move
    alone, so π(x_t | u) = 1 everywhere.
    """

    alpha1: float = param(0.15, "rad/rad", "turning error per turning", low=0, high=LARGEST)
    alpha2: float = param(0.05, "rad/m", "turning error per driving", low=0, high=LARGEST)
    alpha3: float = param(0.10, "m/m", "driving error per driving", low=0, high=LARGEST)
    alpha4: float = param(0.02, "m/rad", "driving error per turning", low=0, high=LARGEST)
    sigma_rot_min: float = param(0.01, "rad", "turning error of any move", above=0, high=LARGEST)
    sigma_trans_min: float = param(0.01, "m", "driving error of any move", above=0, high=LARGEST)
    p_reverse: float = param(0.0, "", "chance that the robot drove the other way", low=0, high=0.5)
    loose: float = param(5.0, "", "factor on all deviations in the doubted model", low=1, high=100)

    def doubted(self) -> "OdometryMotion":
        """The model for wheels that must have lied: they slipped, or count turns without seeing
        their direction.
        """
        factors = {
            name: min(self.loose * getattr(self, name), LARGEST)
            for name in ("alpha1", "alpha2", "alpha3", "alpha4", "sigma_rot_min", "sigma_trans_min")
        }
        return replace(self, **factors, p_reverse=0.5)

    def decompose(self, u: NDArray[np.float64]) -> Decomposition:
        """δ_rot1, δ_trans, δ_rot2 of a move, and their deviations.

        A robot that drives backwards turns by little, not by π; one that turns on the spot has no
        δ_rot1.
        """
        dx, dy, dtheta = (float(v) for v in u)
        trans, rot1 = float(np.hypot(dx, dy)), float(np.arctan2(dy, dx))
        if trans < self.sigma_trans_min:
            rot1 = 0.0
        elif abs(rot1) > np.pi / 2:
            trans, rot1 = -trans, float(wrap(rot1 + np.pi))
        rot2 = float(wrap(dtheta - rot1))
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

    def sample(self, x: States, u: NDArray[np.float64], draws: Draws, first: int) -> States:
        """(3, n): x_t ~ p(x_t | u, x) for each column of x."""
        return self._move(apply_moves, x, u, draws, first)

    def sample_previous(
        self, x_new: States, u: NDArray[np.float64], draws: Draws, first: int
    ) -> States:
        """(3, n): x_{t−1} ~ p(x_new | u, x_{t−1}) / π(x_new | u): a move drawn and undone."""
        return self._move(undo_moves, x_new, u, draws, first)

    def log_pi(self, x_new: States, u: NDArray[np.float64]) -> LogWeights:
        """(n,): 0. The density is a function of ⊖x ⊕ x_new alone, and SE(2) is unimodular."""
        return np.zeros(x_new.shape[1])

    def log_density(self, x_new: States, u: NDArray[np.float64], x: States) -> LogWeights:
        """(n,): log p(x_new | u, x) per m² rad.

        Two ways lead to a place: forwards, and backwards with δ_rot1 turned by π. Polar coordinates
        give the 1/δ_trans.
        """
        d = self.decompose(u)
        driven = ((d.trans, 1.0 - self.p_reverse), (-d.trans, self.p_reverse))
        dx, dy = x_new[0] - x[0], x_new[1] - x[1]
        length = np.maximum(np.hypot(dx, dy), 1e-12)
        bearing = np.arctan2(dy, dx) - x[2]
        turned = x_new[2] - x[2]
        ways = []
        for trans, rot1 in ((length, bearing), (-length, bearing + np.pi)):
            rot2 = turned - rot1
            ways.append(
                _log_wrapped_normal(rot1 - d.rot1, d.sd_rot1)
                + np.logaddexp.reduce(
                    [
                        np.log(p) + _log_normal(trans - mean, d.sd_trans)
                        for mean, p in driven
                        if p > 0.0
                    ]
                )
                + _log_wrapped_normal(rot2 - d.rot2, d.sd_rot2)
            )
        density: LogWeights = np.logaddexp(*ways) - np.log(length)
        return density

    def _move(self, apply, x: States, u: NDArray[np.float64], draws: Draws, first: int) -> States:  # type: ignore[no-untyped-def]
        d, n = self.decompose(u), x.shape[1]
        moves, out = np.empty((3, n)), np.empty((3, n))
        noise = (
            d.rot1,
            d.trans,
            d.rot2,
            d.sd_rot1,
            d.sd_trans,
            d.sd_rot2,
            float(ndtri(self.p_reverse)),
        )
        counter = (first, int(Stream.MOTION), draws.step, draws.part, np.uint64(draws.seed))

        def run(start: int, stop: int) -> None:
            sample_moves(moves, *noise, *counter, start, stop)
            apply(x, moves, out, start, stop)

        share(run, n, 80 * n)
        return out


def _log_normal(x: NDArray[np.float64], sd: float) -> NDArray[np.float64]:
    return -0.5 * (x / sd) ** 2 - math.log(sd * math.sqrt(2.0 * math.pi))


def _log_wrapped_normal(angle: NDArray[np.float64], sd: float) -> NDArray[np.float64]:
    """The normal density wrapped around the circle; two turns each way suffice for sd < 2 rad."""
    around = _log_normal(wrap(angle)[:, None] + _WRAPS, sd)
    density: NDArray[np.float64] = np.logaddexp.reduce(around, axis=1)
    return density
