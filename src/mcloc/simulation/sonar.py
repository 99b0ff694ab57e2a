"""A ring of sonars around a robot: cones, walls that mirror sound away, and crosstalk."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.geometry import Poses
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.registry import param
from mcloc.simulation.laser import Laser


@dataclass(frozen=True)
class SonarRing(Laser):
    """Sonars evenly around the robot: with an even number of them, none looks straight ahead.

    A share `missing` of the echoes is mirrored away and lost; of the readings a share `crosstalk`
    are echoes of another sonar, at any range.
    """

    beams: int = param(16, "", "sonars of the ring", low=7, high=24)
    range_max: float = param(3.0, "m", "what is farther gives no return", above=0.0)
    sigma: float = param(0.0, "m", "deviation of each range", low=0.0)
    sigma_relative: float = param(0.05, "m/m", "deviation that grows with the range", low=0.0)
    cone: float = param(
        math.radians(20.0),
        "rad",
        "opening angle of a beam, which measures what is nearest in it",
        low=0.0,
        high=np.pi,
    )
    missing: float = param(0.05, "", "share of echoes that are mirrored away", low=0.0, high=1.0)
    crosstalk: float = param(0.05, "", "share of echoes of another sonar", low=0.0, high=1.0)
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    source: str = "sonars"

    @property
    def angles(self) -> NDArray[np.float64]:
        """(B,) radians in the ring's frame, 0 ahead, positive to the left."""
        return ring_angles(self.beams)

    def measure(
        self,
        grid: OccupancyGrid,
        robot: Poses,
        rng: np.random.Generator,
        *,
        glass: NDArray[np.bool_] | None = None,
        people: ArrayLike | None = None,
    ) -> NDArray[np.float64]:
        """(N, B) metres, as of a Laser."""
        echoes = super().measure(grid, robot, rng, glass=glass, people=people)
        others = rng.random(echoes.shape) < self.crosstalk
        echoes[others] = rng.uniform(0.0, self.range_max, echoes.shape)[others]
        return echoes


def ring_angles(n: int) -> NDArray[np.float64]:
    """(n,) radians, evenly around the circle and alike to both sides of straight ahead."""
    angles: NDArray[np.float64] = 2.0 * np.pi / n * (np.arange(n, dtype=np.float64) - 0.5 * (n - 1))
    return angles
