"""When a scan is used, and how much of it is news."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.registry import Configurable, param

LEAST_NOVELTY = 0.05  # of a scan from the same place: the sensor's own noise is new


@dataclass(frozen=True)
class UpdatePolicy(Configurable):
    """When a scan is used: after the robot has moved this far or turned this much since the last
    one of the same sensor.
    """

    distance: float = param(0.2, "m", "update after driving this far", low=0)
    angle: float = param(0.2, "rad", "update after turning this far", low=0)
    decorrelation: float = param(
        0.5, "m", "drive (or m·rad turn) after which a scan is news", above=0
    )
    coast: float = param(
        0.5, "m", "drive (or m·rad turn) without any after which wheels alone are followed", above=0
    )

    def due(self, u: NDArray[np.float64], doubtful: bool = False) -> bool:
        """Whether the move u (dx, dy, dθ) is enough.

        doubtful: the last scan said that the wheels lie. Half of it is enough then: a robot that
        went the other way is twice as far from where they say.
        """
        enough = 0.5 if doubtful else 1.0
        moved, turned = np.hypot(u[0], u[1]), abs(u[2])
        return bool(moved >= enough * self.distance or turned >= enough * self.angle)

    def coasted(self, u: NDArray[np.float64]) -> bool:
        """Whether the move u (dx, dy, dθ) is far for one without any scan."""
        return bool(max(np.hypot(u[0], u[1]), abs(u[2])) >= self.coast)

    def novelty(self, u: NDArray[np.float64]) -> float:
        """How much of a scan after the move u is news, LEAST_NOVELTY … 1.

        Scans from nearly the same place meet the same people, doors and errors of the map: ten
        scans on one metre say little more than two.
        """
        moved = np.hypot(u[0], u[1]) + self.decorrelation * abs(u[2])
        return float(np.clip(moved / self.decorrelation, LEAST_NOVELTY, 1.0))
