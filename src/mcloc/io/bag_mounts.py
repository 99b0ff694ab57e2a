"""Where the lasers of a bag sit on the robot: T_base,laser from /tf_static, and else from /tf.

The base is the frame whose pose the odometry tells.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mcloc.errors import ConfigError, LogError
from mcloc.geometry import Pose
from mcloc.io.bag import Bag, Message
from mcloc.io.bag_messages import ODOMETRY, TF, edges, transform_matrix
from mcloc.io.frames import Frames, Transform, frame_name, planar, tilt, upside_down

ODOM = "odom"  # what REP 105 calls the frame that odometry is given in
STATIC = "tf_static"
MOST_TILT = float(np.deg2rad(10.0))  # a beam of 10 m then ends 1.7 m higher or lower
REMEDY = "say where it sits with --mount X,Y,THETA_DEG"


@dataclass(frozen=True, eq=False)
class Laser:
    """frame: of its scans. mount: (3,) its pose in the base frame, seen from above. upside_down:
    whether its angles count to the right.
    """

    frame: str
    mount: Pose
    upside_down: bool = False


def base_frame(bag: Bag, odometry: str, wanted: Collection[str]) -> str:
    """The frame that moves with the robot, by the first message of the odometry topic that tells;
    of transforms, the first one from odom that leads on to a wanted frame, if there is one.

    Raises LogError where no message tells.
    """
    if bag.topics[odometry] == ODOMETRY:
        for _, message in bag.messages([odometry]):
            return frame_name(message.child_frame_id)
        raise unreadable(bag, odometry)
    rigid, moving, seen = Frames(), list[str](), set[str]()
    for topic, parent, child, stamped in _transforms(bag):
        if topic == odometry:
            seen |= {parent, child}
        if parent != ODOM:
            news = rigid.add(parent, child, transform_matrix(stamped))
        elif news := topic == odometry and child not in moving:
            moving.append(child)
        if news:
            for base in moving:
                if any(_found(rigid, base, frame) is not None for frame in wanted):
                    return base
    if moving:
        return moving[0]
    raise LogError(
        f"{bag.path}: holds no odometry: no topic of type {ODOMETRY}, and on {odometry} no "
        f"transform from a frame {ODOM!r}; the frames there: {', '.join(sorted(seen)) or 'none'}"
    )


def unreadable(bag: Bag, topic: str) -> LogError:
    """The error to raise about a topic that is there and yields nothing."""
    return LogError(
        f"{bag.path}: not one message of {topic} can be read as {bag.topics[topic]}; its index may "
        "be missing, or its definition another one"
    )


def laser_frames(bag: Bag, scans: Sequence[str]) -> dict[str, str]:
    """The frame of each scan topic, by its first scan; topics without a readable one are left."""
    found: dict[str, str] = {}
    for topic, scan in bag.messages(scans):
        found.setdefault(topic, frame_name(scan.header.frame_id))
        if len(found) == len(scans):
            break
    return found


def lasers(
    bag: Bag, scans: Sequence[str], frames: Mapping[str, str], base: str, mount: Pose | None
) -> dict[str, Laser]:
    """The laser behind each scan topic. frames: as `laser_frames` has them. mount: (3,) of the only
    one, instead of what the bag says.

    Raises ConfigError for one laser on two topics and for a mount of several; LogError for a topic
    without a readable scan, and for a laser that stands nowhere or aslant.
    """
    _check_distinct(bag, scans, frames)
    if mount is not None:
        if len(scans) > 1:
            raise ConfigError(
                f"{bag.path}: the mount is for one laser, there are {len(scans)}: "
                f"{', '.join(scans)}; choose one with --topic scan={scans[0]}"
            )
        return {scans[0]: Laser(frames[scans[0]], mount)}
    known = _known(bag, base, set(frames.values()))
    found = {}
    for topic in scans:
        matrix = _found(known, base, frames[topic])
        if matrix is None:
            others = [f"--topic scan={other}" for other in scans if other != topic]
            remedy = f"leave it out with {' '.join(others)}" if others else REMEDY
            raise LogError(
                f"{bag.path}: no usable transform leads from the robot's frame {base!r} to the "
                f"frame {frames[topic]!r} of {topic}; {remedy}"
            )
        found[topic] = _laser(bag, topic, frames[topic], matrix)
    return found


def _check_distinct(bag: Bag, scans: Sequence[str], found: Mapping[str, str]) -> None:
    for topic in scans:
        if topic not in found:
            raise unreadable(bag, topic)
    by_frame: dict[str, str] = {}
    for topic in scans:
        other = by_frame.setdefault(found[topic], topic)
        if other != topic:
            raise ConfigError(
                f"{bag.path}: {other} and {topic} are scans of one laser (frame "
                f"{found[topic]!r}); choose with --topic scan={other}"
            )


def _known(bag: Bag, base: str, wanted: set[str]) -> Frames:
    """The transforms that join the wanted frames to the base, as far as the bag has them. None from
    odom: what hangs there moves.
    """
    frames = Frames()

    def joined() -> bool:
        return all(_found(frames, base, frame) is not None for frame in wanted)

    if joined():
        return frames
    for _, parent, child, stamped in _transforms(bag):
        if parent != ODOM and frames.add(parent, child, transform_matrix(stamped)) and joined():
            break
    return frames


def _transforms(bag: Bag) -> Iterator[tuple[str, str, str, Message]]:
    """Topic, parent frame, child frame and TransformStamped: from /tf_static, and then from /tf,
    since some robots publish fixed mounts there.
    """
    topics = bag.of_type(*TF)
    static = [topic for topic in topics if topic.endswith(STATIC)]
    for group in (static, [topic for topic in topics if topic not in static]):
        for topic, message in bag.messages(group):
            for edge in edges(message):
                yield topic, *edge


def _found(frames: Frames, base: str, frame: str) -> Transform | None:
    """Frames without a name are not one frame."""
    return frames.find(base, frame) if base and frame else None


def _laser(bag: Bag, topic: str, frame: str, matrix: Transform) -> Laser:
    if tilt(matrix) > MOST_TILT:
        raise LogError(
            f"{bag.path}: the laser of {topic} (frame {frame!r}) is tilted by "
            f"{np.rad2deg(tilt(matrix)):.0f}° against the floor; choose another one with "
            "--topic scan=…"
        )
    return Laser(frame, planar(matrix), upside_down(matrix))
