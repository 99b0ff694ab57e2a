"""Wheels that misjudge a drive: by errors that stay, by random ones, and by slipping."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.geometry import Poses, between, wrap
from mcloc.registry import Configurable, param

SLIP = 0.3  # m of the way that wheels slip at a time


@dataclass(frozen=True)
class Wheels(Configurable):
    """How wheels misjudge a drive.

    Variances grow in proportion to the distance or the turn, so that the error of a drive does not
    depend on how finely it is cut into steps. Where they slip, for 0.3 m at a time, wheels spin or
    slide: they report a distance too long or too short by a factor, and miss a turn of the robot.
    """

    scale: float = param(0.02, "", "excess of each distance and turn", low=-0.5, high=0.5)
    drift: float = param(0.01, "rad/m", "turn to the left for each metre", low=-1.0, high=1.0)
    sigma_distance: float = param(0.03, "m", "deviation after 1 m", low=0.0)
    sigma_turn: float = param(0.03, "rad", "deviation after a turn by 1 rad", low=0.0)
    sigma_drift: float = param(0.02, "rad", "deviation of the heading after 1 m", low=0.0)
    slip: float = param(0.0, "", "share of the way on which they slip", low=0.0, high=1.0)
    sigma_slip: float = param(0.4, "m/m", "deviation of a slip's excess of distance", low=0.0)
    sigma_slip_turn: float = param(0.6, "rad/m", "deviation of a slip's turn", low=0.0)

    def measure(
        self, truth: Poses, rng: np.random.Generator, kidnapped: Sequence[int] = ()
    ) -> Poses:
        """(N, 3) odometry of a drive through the poses `truth` (N, 3); its frame starts at 0.

        kidnapped: indices of poses to which the robot was carried: its wheels stood still.
        """
        motion = between(truth[:-1], truth[1:])
        motion[np.array(kidnapped, dtype=np.intp) - 1] = 0.0
        ahead, left, turn = motion.T
        distance = np.hypot(ahead, left)
        along, about, astray = rng.standard_normal((3, len(turn)))
        excess, swerve = self._slips(distance, rng)
        ahead = (1.0 + self.scale + excess) * ahead + self.sigma_distance * np.sqrt(
            distance
        ) * along
        turn = (
            (1.0 + self.scale) * turn
            + (self.drift + swerve) * distance
            + self.sigma_turn * np.sqrt(np.abs(turn)) * about
            + self.sigma_drift * np.sqrt(distance) * astray
        )

        odometry = np.zeros_like(truth)
        heading = np.concatenate([[0.0], np.cumsum(turn)])
        odometry[:, 2] = wrap(heading)
        cos, sin = np.cos(heading[:-1]), np.sin(heading[:-1])
        odometry[1:, 0] = np.cumsum(cos * ahead - sin * left)
        odometry[1:, 1] = np.cumsum(sin * ahead + cos * left)
        return odometry

    def _slips(
        self, distance: NDArray[np.float64], rng: np.random.Generator
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Excess of the distance (m/m) and turn (rad/m) of each step (N − 1,); 0 without a slip."""
        stretch = (np.cumsum(distance) / SLIP).astype(np.intp)
        n = stretch[-1] + 1 if stretch.size else 0
        slipping = rng.random(n) < self.slip
        excess, swerve = slipping * rng.standard_normal((2, n))
        return (self.sigma_slip * excess)[stretch], (self.sigma_slip_turn * swerve)[stretch]
