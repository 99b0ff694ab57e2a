"""What a robot tells of another one."""

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from mcloc.geometry import Pose


@dataclass(frozen=True, eq=False, slots=True)
class Detection:
    """Another robot that a robot saw: nothing that one robot could be localized by alone.

    t: seconds. seen: the other one's name. range: metres to its middle. bearing: radians from the
    sensor's heading, positive to the left; NaN where it was not measured. heading: radians, the
    other one's heading less the sensor's; NaN where it was not measured. mount: (3,) the sensor's
    pose in the robot's frame.
    """

    called: ClassVar[str] = "detection"

    t: float
    seen: str
    range: float
    bearing: float
    heading: float = math.nan
    mount: Pose = field(default_factory=lambda: np.zeros(3))
