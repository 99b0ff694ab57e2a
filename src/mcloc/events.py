"""What a robot reports: events with stamps, in the robot's own frames."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.geometry import Pose

BEACON = "beacon "  # and its number: the source of the readings of one
UNKNOWN = -1  # landmark: one of them, or none of them, and nobody knows which


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


@dataclass(frozen=True, eq=False, slots=True)
class Sightings:
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


@dataclass(frozen=True, eq=False, slots=True)
class BeaconRanges:
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

    def of_each(self) -> Iterator["BeaconRanges"]:
        """The readings one by one, each beacon a source of its own."""
        for k, beacon in enumerate(self.beacon.tolist()):
            one = slice(k, k + 1)
            yield replace(
                self,
                beacon=self.beacon[one],
                range=self.range[one],
                source=f"{BEACON}{beacon}",
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


@dataclass(frozen=True, eq=False, slots=True)
class Image:
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


@dataclass(frozen=True, eq=False, slots=True)
class Message:
    """What another robot told of where this one is: a density tree, of places x, y or of poses x,
    y, θ, map frame.

    t: seconds, of the moment that it is about. low … weight: the tree, as of DensityTree, and
    floor. p_false: the chance that the detection behind it was none; then each place, or pose, has
    the density `even` (1/m² or 1/(m² rad)), > 0. odometry, novelty, source: as of a Scan; the
    source names the other robot. Raises ConfigError for a tree of no such axes.
    """

    called: ClassVar[str] = "message"
    empty: ClassVar[str] = "message that says nothing"
    repeats: ClassVar[bool] = False

    t: float
    low: NDArray[np.float64]
    side: NDArray[np.float64]
    axis: NDArray[np.uint64]
    split: NDArray[np.float64]
    child: NDArray[np.uint64]
    corner: NDArray[np.float64]
    width: NDArray[np.float64]
    weight: NDArray[np.float64]
    floor: float
    p_false: float
    even: float
    source: str
    odometry: Pose | None = None
    novelty: float = 1.0

    def __post_init__(self) -> None:
        if len(self.low) not in (2, 3):
            raise ConfigError(
                f"a message is of places x, y or poses x, y, θ, got {len(self.low)} axes"
            )

    @property
    def useful(self) -> bool:
        """Whether anything is told."""
        return self.p_false < 1.0


Measurement = Scan | Sightings | BeaconRanges | Image | Message
"""What a sensor tells. called: its name in messages; empty: that of one that is not `useful`.
repeats: whether another one from the same place makes the same errors, so that the robot has to
move before it is news.
"""

MEASUREMENTS: tuple[type[Measurement], ...] = (Scan, Sightings, BeaconRanges, Image, Message)

Event = Odometry | Measurement


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


def arrays_of(event: Event) -> dict[str, NDArray[np.float64]]:
    """{name: array} of an event's fields that are arrays."""
    values = {f.name: getattr(event, f.name) for f in fields(event)}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}


class Log(Protocol):
    """A recorded log: iterate over it to get its events, in the order of the file, streaming.

    Iterating again starts again. Raises LogError in mid-stream where the file is cut or spoilt:
    events before the damage have been delivered. `skipped` counts, by reason, what the last
    iteration left out.
    """

    path: str
    skipped: dict[str, int]

    def __iter__(self) -> Iterator[Event]: ...
