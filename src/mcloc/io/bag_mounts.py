"""Where the lasers of a bag sit on the robot: T_base,laser from /tf_static, and else from /tf.

The base is the frame whose pose the odometry tells.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mcloc.errors import ConfigError, LogError
from mcloc.geometry import Pose
from mcloc.io.bag import Bag
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


def base_frame(bag: Bag, odometry: str) -> str:
    """The frame that moves with the robot, by the first message of the odometry topic that tells.

    Raises LogError where none does.
    """
    seen: set[str] = set()
    for _, message in bag.messages([odometry]):
        if bag.topics[odometry] == ODOMETRY:
            return frame_name(message.child_frame_id)
        for parent, child, _ in edges(message):
            if parent == ODOM:
                return child
            seen |= {parent, child}
    if bag.topics[odometry] == ODOMETRY:
        raise unreadable(bag, odometry)
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


def lasers(bag: Bag, scans: Sequence[str], base: str, mount: Pose | None) -> dict[str, Laser]:
    """The laser behind each scan topic. mount: (3,) of the only one, instead of what the bag says.

    Raises ConfigError for one laser on two topics and for a mount of several; LogError for a topic
    without a readable scan, and for a laser that stands nowhere or aslant.
    """
    frames = _frames_of(bag, scans)
    if mount is not None:
        if len(scans) > 1:
            raise ConfigError(
                f"{bag.path}: the mount is for one laser, there are {len(scans)}: "
                f"{', '.join(scans)}; choose one with --topic scan={scans[0]}"
            )
        return {scans[0]: Laser(frames[scans[0]], mount)}
    known = _known(bag, base, set(frames.values()))
    return {
        topic: _laser(bag, topic, frame, base, _found(known, base, frame))
        for topic, frame in frames.items()
    }


def _frames_of(bag: Bag, scans: Sequence[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for topic, scan in bag.messages(scans):
        found.setdefault(topic, frame_name(scan.header.frame_id))
        if len(found) == len(scans):
            break
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
    return found


def _known(bag: Bag, base: str, wanted: set[str]) -> Frames:
    """The transforms that join the wanted frames to the base, as far as the bag has them: from
    /tf_static, and else from /tf, since some robots publish fixed mounts there.
    """
    frames = Frames()
    topics = bag.of_type(*TF)
    static = [topic for topic in topics if topic.endswith(STATIC)]
    moving = [topic for topic in topics if topic not in static]

    def joined() -> bool:
        return all(_found(frames, base, frame) is not None for frame in wanted)

    for group in (static, moving):
        if joined():
            break
        for _, message in bag.messages(group):
            news = [
                frames.add(parent, child, transform_matrix(stamped))
                for parent, child, stamped in edges(message)
            ]
            if any(news) and joined():
                break
    return frames


def _found(frames: Frames, base: str, frame: str) -> Transform | None:
    """Frames without a name are not one frame."""
    return frames.find(base, frame) if base and frame else None


def _laser(bag: Bag, topic: str, frame: str, base: str, matrix: Transform | None) -> Laser:
    if matrix is None:
        raise LogError(
            f"{bag.path}: no usable transform leads from the robot's frame {base!r} to the frame "
            f"{frame!r} of {topic}; {REMEDY}"
        )
    if tilt(matrix) > MOST_TILT:
        raise LogError(
            f"{bag.path}: the laser of {topic} (frame {frame!r}) is tilted by "
            f"{np.rad2deg(tilt(matrix)):.0f}° against the floor; choose another one with "
            "--topic scan=…"
        )
    return Laser(frame, planar(matrix), upside_down(matrix))
