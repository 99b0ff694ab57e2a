"""What a robot reports: events with stamps, in the robot's own frames."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mcloc.geometry import Pose


@dataclass(frozen=True, slots=True)
class Odometry:
    """The robot's pose by its wheels alone, in a frame of its own that drifts against the map.

    t: seconds. pose: (3,) x, y in metres, θ in radians, odometry frame.
    """

    t: float
    pose: Pose


@dataclass(frozen=True, slots=True)
class Scan:
    """One sweep of a range finder.

    t: seconds. ranges: (B,) metres; anything that is not a return stays as the log has it, the
    sensor model decides what it means. angles: (B,) radians in the sensor's frame, 0 ahead,
    positive to the left. range_max: metres, a reading at or above it is no return. mount: (3,) the
    sensor's pose in the robot's frame. odometry: (3,) the odometry pose that the log itself gives
    for the moment of the scan, or None: then it is interpolated to t. novelty: 0 … 1, how much of
    it is news after the last scan that was used; the runtime sets it. range_min: metres, a reading
    below it is no return. source: which of the robot's lasers it comes from.
    """

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


Event = Odometry | Scan


class Log(Protocol):
    """A recorded log: iterate over it to get its events, in the order of the file, streaming.

    Iterating again starts again. Raises LogError in mid-stream where the file is cut or spoilt:
    events before the damage have been delivered. `skipped` counts, by reason, what the last
    iteration left out.
    """

    path: str
    skipped: dict[str, int]

    def __iter__(self) -> Iterator[Event]: ...
