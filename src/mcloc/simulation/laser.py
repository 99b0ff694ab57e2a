"""A range finder that errs: noise, missing returns, limits, glass; it sees walls and people."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.errors import ConfigError
from mcloc.geometry import Poses, compose
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.registry import Configurable, param
from mcloc.simulation.discs import ranges_to_discs
from mcloc.simulation.glass import ranges_past_glass
from mcloc.simulation.people import RADIUS
from mcloc.simulation.ranges import ranges

APART = math.radians(1.0)  # between two rays of a cone at most: a cell of 5 cm at 3 m


@dataclass(frozen=True)
class Laser(Configurable):
    """A range finder; by default it looks half around, as in CARMEN logs. With a cone it is a ring
    of sonars.

    mount: x, y, θ of the laser in the robot's frame, metres and radians. source: its name.
    """

    beams: int = param(181, "", "beams of a scan", low=2, high=100_000)
    fov: float = param(np.pi, "rad", "from the first beam to the last", above=0.0, high=2 * np.pi)
    range_min: float = param(0.0, "m", "what is nearer gives no return", low=0.0)
    range_max: float = param(10.0, "m", "nor does what is farther", above=0.0)
    sigma: float = param(0.02, "m", "deviation of each range", low=0.0)
    sigma_relative: float = param(0.0, "m/m", "deviation that grows with the range", low=0.0)
    cone: float = param(
        0.0,
        "rad",
        "opening angle of a beam, which measures what is nearest in it",
        low=0.0,
        high=np.pi,
    )
    missing: float = param(0.02, "", "chance of a beam not to return", low=0.0, high=1.0)
    mount: tuple[float, float, float] = (0.15, 0.05, 0.0)
    source: str = "laser"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.range_min >= self.range_max:
            raise ConfigError(f"Laser.range_min must be < range_max, got {self.range_min} m")
        if np.shape(self.mount) != (3,) or not np.isfinite(self.mount).all():
            raise ConfigError(f"Laser.mount must be x, y, θ, got {self.mount}")

    @property
    def angles(self) -> NDArray[np.float64]:
        """(B,) radians in the laser's frame, 0 ahead, positive to the left."""
        return np.linspace(-self.fov / 2, self.fov / 2, self.beams)

    def measure(
        self,
        grid: OccupancyGrid,
        robot: Poses,
        rng: np.random.Generator,
        *,
        glass: NDArray[np.bool_] | None = None,
        people: ArrayLike | None = None,
    ) -> NDArray[np.float64]:
        """(N, B) metres measured by a robot at the poses (N, 3); inf where nothing returns.

        glass: the cells (height, width) that beams may pass. people: (P, N, 2) where they are at
        each pose, metres, map frame.
        """
        sensor, fans = compose(robot, self.mount), self._fans
        angles = fans.ravel()
        if glass is None:
            exact = ranges(grid, sensor, angles, self.range_max)
        else:
            exact = ranges_past_glass(grid, glass, sensor, angles, self.range_max, rng)
        if people is not None:
            to_people = ranges_to_discs(sensor, angles, self.range_max, people, RADIUS)
            exact = np.minimum(exact, to_people)
        exact = exact.reshape(-1, *fans.shape).min(axis=2)
        in_reach = np.minimum(exact, self.range_max)  # inf has no deviation
        sigma = np.hypot(self.sigma, self.sigma_relative * in_reach)
        measured = np.maximum(exact + sigma * rng.standard_normal(exact.shape), 0.0)
        seen = (measured >= self.range_min) & (measured < self.range_max)
        return np.where(seen & (rng.random(exact.shape) >= self.missing), measured, np.inf)

    @property
    def _fans(self) -> NDArray[np.float64]:
        """(B, F) radians: the rays of each beam, from one edge of its cone to the other."""
        half = self.cone / 2.0
        return self.angles[:, None] + np.linspace(-half, half, 1 + 2 * math.ceil(half / APART))
