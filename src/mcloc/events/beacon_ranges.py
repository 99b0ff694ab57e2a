"""What is told of radio beacons."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.events.measured import Measured
from mcloc.geometry import Pose


@dataclass(frozen=True, eq=False, slots=True)
class BeaconRanges(Measured):
    """Distances to radio beacons, measured at one time.

    t: seconds. beacon: (k,) which ones, by their index in the map. range: (k,) metres in space; one
    that is not > 0, or not finite, is none. antenna: (3,) metres ahead, to the left and up, in the
    robot's frame. odometry, novelty, source: as of a Scan. heard, failed: (k,) how many earlier
    readings of each of these beacons were news, and how many of them did not fit. usual: the share
    that did not fit of a typical one of the robot's sensors. alone: whether it has only beacons.
    The runtime sets these four. Raises ConfigError for arrays that are not (k,), or beacons that
    are no whole numbers from 0 on.
    """

    called: ClassVar[str] = "beacon reading"
    empty: ClassVar[str] = "beacon reading without a range"
    repeats: ClassVar[bool] = True
    conclusive: ClassVar[bool] = False  # one that is off is an outlier more often than a lie

    t: float
    beacon: NDArray[np.intp]
    range: NDArray[np.float64]
    antenna: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    odometry: Pose | None = None
    novelty: float = 1.0
    source: str = "beacons"
    heard: NDArray[np.float64] = field(default_factory=lambda: np.zeros(1))
    failed: NDArray[np.float64] = field(default_factory=lambda: np.zeros(1))
    usual: float = 0.0
    alone: bool = True

    def __post_init__(self) -> None:
        beacon, ranges = (np.asarray(v, dtype=np.float64) for v in (self.beacon, self.range))
        if beacon.ndim != 1 or ranges.shape != beacon.shape:
            raise ConfigError(
                f"ranges are of a beacon each, got shapes {beacon.shape} and {ranges.shape}"
            )
        if not ((beacon == np.rint(beacon)) & (beacon >= 0)).all():
            raise ConfigError(f"beacons must be whole numbers from 0 on, got {beacon.tolist()}")
        object.__setattr__(self, "beacon", beacon.astype(np.intp))
        object.__setattr__(self, "range", ranges)
        for name in ("heard", "failed"):
            counts = np.asarray(getattr(self, name), dtype=np.float64)
            object.__setattr__(self, name, np.broadcast_to(counts, beacon.shape))

    def parts(self) -> Iterator[Self]:
        """The readings one by one, each beacon a source of its own."""
        for k, beacon in enumerate(self.beacon.tolist()):
            one = slice(k, k + 1)
            yield replace(
                self,
                beacon=self.beacon[one],
                range=self.range[one],
                source=f"beacon {beacon}",
                heard=self.heard[one],
                failed=self.failed[one],
            )

    @property
    def returned(self) -> NDArray[np.bool_]:
        """(k,): which readings are distances."""
        return np.isfinite(self.range) & (self.range > 0.0)

    @property
    def useful(self) -> bool:
        """Whether any reading is a distance."""
        return bool(self.returned.any())
