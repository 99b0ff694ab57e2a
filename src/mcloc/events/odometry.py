"""What the wheels tell."""

from dataclasses import dataclass

from mcloc.geometry import Pose


@dataclass(frozen=True, slots=True)
class Odometry:
    """The robot's pose by its wheels alone, in a frame of its own that drifts against the map.

    t: seconds. pose: (3,) x, y in metres, θ in radians, odometry frame.
    """

    t: float
    pose: Pose
