"""Logs of CMU's Wean Hall: centimetres, radians, seconds.

    O x y theta t
    L x y theta laser_x laser_y laser_theta r1 … r180 t

The pose of an L line belongs to the moment of the sweep, a little older than the O lines around it.
"""

from collections.abc import Iterator

from mcloc.events import Event, Odometry, Scan
from mcloc.geometry import Pose
from mcloc.io import messages
from mcloc.io.messages import Fields, Format, Skipped, expect, floats, mount_of
from mcloc.io.sick import RANGE_MAX, beam_angles
from mcloc.textfile import TextFile

BEAMS = 180
METRE = 0.01  # a centimetre in metres


def _pose(fields: Fields) -> Pose:
    pose = floats(fields)
    pose[:2] *= METRE
    return pose


def _odometry(fields: Fields) -> Odometry:
    expect(fields, 4)
    return Odometry(float(fields[3]), _pose(fields[:3]))


def _scan(fields: Fields) -> Scan:
    expect(fields, BEAMS + 7)
    robot, ranges = _pose(fields[:3]), METRE * floats(fields[6:-1])
    return Scan(
        t=float(fields[-1]),
        ranges=ranges,
        angles=beam_angles(len(ranges)),
        range_max=RANGE_MAX,
        mount=mount_of(_pose(fields[3:6]), robot),
        odometry=robot,
    )


def _recognizes(words: Fields) -> bool:
    try:
        return words[0] in ("O", "L") and len(floats(words[1:4])) > 0
    except ValueError:
        return False


def _events(text: TextFile, skipped: Skipped) -> Iterator[Event]:
    return messages.events(text, {"O": _odometry, "L": _scan}, skipped)


WEAN = Format("CMU Wean Hall (O and L lines)", _recognizes, _events)
