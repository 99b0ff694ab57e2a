"""What is told of landmarks."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.events.measured import Measured
from mcloc.geometry import Pose

UNKNOWN = -1  # landmark: one of them, or none of them, and nobody knows which


@dataclass(frozen=True, eq=False, slots=True)
class Sightings(Measured):
    """Landmarks that a robot saw at one time.

    t: seconds. landmark: (k,) which ones, by their index in the map, UNKNOWN for those whose
    identity was not told; one that was seen twice is twice there. range: (k,) metres. bearing: (k,)
    radians from the sensor's heading, positive to the left. NaN for what was not measured. mount:
    (3,) the sensor's pose in the robot's frame. odometry, novelty, source: as of a Scan. Raises
    ConfigError for arrays that are not (k,), or landmarks that are no whole numbers from UNKNOWN
    on.
    """

    called: ClassVar[str] = "sighting"
    empty: ClassVar[str] = "sighting without range or bearing"
    repeats: ClassVar[bool] = False

    t: float
    landmark: NDArray[np.intp]
    range: NDArray[np.float64]
    bearing: NDArray[np.float64]
    mount: Pose = field(default_factory=lambda: np.zeros(3))
    odometry: Pose | None = None
    novelty: float = 1.0
    source: str = "landmarks"

    def __post_init__(self) -> None:
        landmark, *measured = (
            np.asarray(v, dtype=np.float64) for v in (self.landmark, self.range, self.bearing)
        )
        if landmark.ndim != 1 or any(v.shape != landmark.shape for v in measured):
            raise ConfigError(
                "sightings are a landmark, a range and a bearing each, got shapes "
                f"{landmark.shape}, {measured[0].shape} and {measured[1].shape}"
            )
        if not ((landmark == np.rint(landmark)) & (landmark >= UNKNOWN)).all():
            raise ConfigError(
                f"landmarks must be whole numbers from {UNKNOWN} on, got {landmark.tolist()}"
            )
        object.__setattr__(self, "landmark", landmark.astype(np.intp))
        object.__setattr__(self, "range", measured[0])
        object.__setattr__(self, "bearing", measured[1])

    @property
    def useful(self) -> bool:
        """Whether anything was measured."""
        return bool((np.isfinite(self.range) | np.isfinite(self.bearing)).any())
