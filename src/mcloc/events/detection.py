"""What a robot tells of another one."""

import math
from contextlib import suppress
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.geometry import Pose


@dataclass(frozen=True, eq=False, slots=True)
class Detection:
    """Another robot that a robot saw: nothing that one robot could be localized by alone.

    t: seconds. seen: the other one's name. range: metres to its middle. bearing: radians from the
    sensor's heading, positive to the left; NaN where it was not measured. heading: radians, the
    other one's heading less the sensor's; NaN where it was not measured. mount: (3,) the sensor's
    pose in the robot's frame. Raises ConfigError for a name that is no text, and for what is no
    number.
    """

    called: ClassVar[str] = "detection"

    t: float
    seen: str
    range: float
    bearing: float
    heading: float = math.nan
    mount: Pose = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        if not isinstance(self.seen, str):
            raise ConfigError(f"a detection is of a robot by its name, got {self.seen!r}")
        for name in ("t", "range", "bearing", "heading"):
            object.__setattr__(self, name, float(self._numbers(name, "a number", ())))
        object.__setattr__(self, "mount", self._numbers("mount", "three numbers", (3,)))

    def _numbers(self, name: str, wanted: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
        given = getattr(self, name)
        with suppress(ValueError):  # of rows that differ in length
            if (value := np.asarray(given)).dtype.kind in "fiu" and value.shape == shape:
                return value.astype(np.float64)
        raise ConfigError(f"{name} of a detection must be {wanted}, got {given!r}")
