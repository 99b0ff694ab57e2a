"""A ROS bag as a log: LaserScan → Scan, Odometry or the transforms odom → base → Odometry, and of
a ceiling camera Image or CompressedImage → Image.

Events come in the order of the recording; their stamps are those of the headers, when a thing was
measured. Each scan topic is a laser of its own, called after its topic.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError, LogError
from mcloc.events import Event, Odometry, Scan
from mcloc.geometry import Pose
from mcloc.io.bag import Bag, Message, open_bag
from mcloc.io.bag_files import BagFiles
from mcloc.io.bag_images import image_of
from mcloc.io.bag_messages import (
    COMPRESSED_IMAGE,
    IMAGE,
    LASER_SCAN,
    ODOMETRY,
    TF,
    edges,
    pose_matrix,
    seconds,
    transform_matrix,
)
from mcloc.io.bag_mounts import ODOM, STATIC, Laser, base_frame, laser_frames, lasers
from mcloc.io.frames import frame_name, planar
from mcloc.io.messages import Skipped
from mcloc.registry import suggest

ROLES = ("scan", "odometry", "image")

Topics = Mapping[str, str | Sequence[str]]


@dataclass(frozen=True, eq=False)
class _BagEvents:
    """The events of a bag, of which is known what is read from it and how."""

    files: BagFiles
    lasers: Mapping[str, Laser]
    odometry: str
    base: str
    cameras: Sequence[str] = ()

    def __call__(self, skipped: Skipped) -> Iterator[Event]:
        with open_bag(self.files) as bag:
            for topic, message in bag.messages(self._read, skipped):
                for event in self._events(topic, bag.topics[topic], message):
                    if isinstance(event, str):
                        skipped[event] += 1
                    else:
                        yield event

    @property
    def _read(self) -> list[str]:
        return [*self.lasers, *self.cameras, self.odometry]

    def _events(self, topic: str, kind: str, message: Message) -> Iterator[Event | str]:
        """What a message tells, or why it tells nothing."""
        if kind == LASER_SCAN:
            yield _scan(topic, self.lasers[topic], message)
        elif topic in self.cameras:
            yield image_of(topic, kind, message)
        elif kind == ODOMETRY:
            yield _odometry(message, planar(pose_matrix(message.pose.pose)))
        else:
            for parent, child, stamped in edges(message):
                if parent == ODOM and child == self.base:
                    yield _odometry(stamped, planar(transform_matrix(stamped)))


def bag_events(
    files: BagFiles, mount: Pose | None, topics: Topics | None
) -> Callable[[Skipped], Iterator[Event]]:
    """What gives the events of a bag, each time from the first on, counting what it leaves out.

    mount: (3,) of the only laser. topics: of the roles scan (one or several), odometry (a topic of
    Odometry or TFMessage) and image (one or several, of a camera that looks at the ceiling); of
    the first two by default those whose type fits, but no images. A bag of which images are read
    needs no scans. Raises LogError and ConfigError.
    """
    wanted = _wanted(topics or {})
    with open_bag(files) as bag:
        scans = _scans(bag, wanted.get("scan", []))
        cameras = [bag.topic(name, IMAGE, COMPRESSED_IMAGE) for name in wanted.get("image", [])]
        if not scans and not cameras:
            raise LogError(f"{bag.path}: holds no {LASER_SCAN}; its topics: {bag.listing()}")
        odometry = _odometry_topic(bag, wanted.get("odometry", []))
        frames = laser_frames(bag, scans)
        base = base_frame(bag, odometry, frames.values())
        at = lasers(bag, scans, frames, base, mount)
        return _BagEvents(files, at, odometry, base, list(dict.fromkeys(cameras)))


def bag_odometry(files: BagFiles, topics: Topics | None) -> Callable[[Skipped], Iterator[Event]]:
    """The same without the scans: where the lasers sit need not be known."""
    wanted = _wanted(topics or {})
    with open_bag(files) as bag:
        odometry = _odometry_topic(bag, wanted.get("odometry", []))
        frames = laser_frames(bag, _scans(bag, wanted.get("scan", [])))
        return _BagEvents(files, {}, odometry, base_frame(bag, odometry, frames.values()))


def _wanted(topics: Topics) -> dict[str, list[str]]:
    wanted = {}
    for role, names in topics.items():
        if role not in ROLES:
            raise ConfigError(f"unknown role {role!r} of a topic; {suggest(role, ROLES)}")
        wanted[role] = [names] if isinstance(names, str) else list(names)
    if len(wanted.get("odometry", [])) > 1:
        raise ConfigError(f"odometry comes from one topic, got {', '.join(wanted['odometry'])}")
    return wanted


def _scans(bag: Bag, wanted: Sequence[str]) -> list[str]:
    found = [bag.topic(name, LASER_SCAN) for name in wanted] or bag.of_type(LASER_SCAN)
    return list(dict.fromkeys(found))


def _odometry_topic(bag: Bag, wanted: Sequence[str]) -> str:
    moving = [topic for topic in bag.of_type(*TF) if not topic.endswith(STATIC)]
    found = [bag.topic(name, ODOMETRY, *TF) for name in wanted] or bag.of_type(ODOMETRY) or moving
    if not found:
        raise LogError(
            f"{bag.path}: holds no odometry, neither {ODOMETRY} nor transforms on /tf; "
            f"its topics: {bag.listing()}"
        )
    if len(found) > 1:
        found.sort(key=lambda topic: (topic.strip("/") != ODOM, len(topic)))  # the likely one first
        raise ConfigError(
            f"{bag.path}: odometry may come from {', '.join(found)}; choose with "
            f"--topic odometry={found[0]}"
        )
    return found[0]


def _odometry(stamped: Message, pose: Pose) -> Odometry | str:
    """The event, or why there is none."""
    t = seconds(stamped)
    return "stamp not set" if t is None else Odometry(t, pose)


def _scan(topic: str, laser: Laser, scan: Message) -> Scan | str:
    """The event, or why there is none."""
    t = seconds(scan)
    if t is None:
        return "stamp not set"
    if (frame := frame_name(scan.header.frame_id)) != laser.frame:
        return f"scan of frame {frame!r} on {topic}"
    if not (scan.range_max > 0.0 and scan.range_min < scan.range_max):
        return "scan without range limits"
    n = len(scan.ranges)
    if not np.isfinite(scan.angle_min + scan.angle_increment) or (
        n > 1 and scan.angle_increment == 0.0
    ):
        return "scan without angles"
    return Scan(
        t=t,
        ranges=np.asarray(scan.ranges, dtype=np.float64),
        angles=_angles(n, scan.angle_min, scan.angle_increment, laser.upside_down),
        range_max=float(scan.range_max),
        mount=laser.mount,
        range_min=float(scan.range_min),
        source=topic,
    )


@lru_cache(maxsize=64)
def _angles(n: int, first: float, step: float, upside_down: bool) -> NDArray[np.float64]:
    """(n,): positive to the left as seen from above."""
    angles = first + step * np.arange(n, dtype=np.float64)
    return -angles if upside_down else angles
