"""What a range finder tells."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mcloc.events.measured import Measured
from mcloc.geometry import Pose


@dataclass(frozen=True, slots=True)
class Scan(Measured):
    """One sweep of a range finder.

    t: seconds. ranges: (B,) metres; anything that is not a return stays as the log has it, the
    sensor model decides what it means. angles: (B,) radians in the sensor's frame, 0 ahead,
    positive to the left. range_max: metres, a reading at or above it is no return. mount: (3,) the
    sensor's pose in the robot's frame. odometry: (3,) the odometry pose that the log itself gives
    for the moment of the scan, or None: then it is interpolated to t. novelty: 0 … 1, how much of
    it is news after the last scan that was used; the runtime sets it. range_min: metres, a reading
    below it is no return. source: which of the robot's lasers it comes from.
    """

    called: ClassVar[str] = "scan"
    empty: ClassVar[str] = "scan without returns"
    repeats: ClassVar[bool] = True

    t: float
    ranges: NDArray[np.float64]
    angles: NDArray[np.float64]
    range_max: float
    mount: Pose = field(default_factory=lambda: np.zeros(3))
    odometry: Pose | None = None
    novelty: float = 1.0
    range_min: float = 0.0
    source: str = "laser"

    @property
    def returned(self) -> NDArray[np.bool_]:
        """(B,): which readings are distances to something: finite, > 0, from range_min to below
        range_max.
        """
        r = self.ranges
        within: NDArray[np.bool_] = (r > 0.0) & (r >= self.range_min) & (r < self.range_max)
        return within & (r < np.inf)

    @property
    def useful(self) -> bool:
        """Whether anything returned."""
        return bool(self.returned.any())
