"""What a camera tells."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mcloc.events.measured import Measured
from mcloc.geometry import Pose


@dataclass(frozen=True, eq=False, slots=True)
class Image(Measured):
    """What a camera saw of the ceiling, straight up.

    t: seconds. pixels: (H, W) brightness 0 … 1; the first row is the farthest ahead of the robot,
    the first column the farthest to its left. odometry, novelty, source: as of a Scan.
    """

    called: ClassVar[str] = "image"
    empty: ClassVar[str] = "image without pixels"
    repeats: ClassVar[bool] = True

    t: float
    pixels: NDArray[np.float64]
    odometry: Pose | None = None
    novelty: float = 1.0
    source: str = "camera"

    @property
    def useful(self) -> bool:
        """Whether any pixel is a number."""
        return bool(np.isfinite(self.pixels).any())
