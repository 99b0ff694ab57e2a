"""Recorded logs of any known format, as events in the order of the file."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mcloc.density import FAR
from mcloc.errors import ConfigError, LogError
from mcloc.events import Event, Log, Odometry, Scan
from mcloc.geometry import Pose
from mcloc.io.bag_files import find_bag
from mcloc.io.bag_log import Topics, bag_events, bag_odometry
from mcloc.io.carmen import CARMEN
from mcloc.io.messages import Format, Skipped
from mcloc.io.mrclam import Mrclam, is_mrclam
from mcloc.io.wean import WEAN
from mcloc.textfile import TextFile

FORMATS: tuple[Format, ...] = (CARMEN, WEAN)  # of text logs

MOST_MOUNTS = 4  # lasers on one robot
SAME_MOUNT = 0.05  # m, rad


def read_log(
    path: str | Path,
    mount: ArrayLike | None = None,
    topics: Topics | None = None,
    robot: int | None = None,
) -> Log:
    """The log in a file or a folder, its format told by its content; text may be gzip.

    mount: (3,) x, y in metres, θ in radians: the laser's pose in the robot's frame, or the
    camera's, instead of what the log says. topics: which topics of a ROS bag to read, of the roles
    scan (one or several) and odometry; by default those whose type fits. robot: which one of an
    MRCLAM folder. Raises LogError for a file that is missing, unreadable, empty or no known log,
    and for a bag without scans or odometry; ConfigError for a mount that is no pose, for topics or
    a robot that are not there, and where these leave a choice.
    """
    at = _checked(mount)
    if is_mrclam(path):
        if topics:
            raise ConfigError(f"{path}: topics are of ROS bags; this is an MRCLAM folder")
        folder = Mrclam(str(path), robot)
        return _FileLog(str(path), partial(folder.events, np.zeros(3) if at is None else at))
    if robot is not None:
        raise ConfigError(f"{path}: robots are of MRCLAM folders; leave --robot out")
    if (bag := find_bag(path)) is not None:
        return _FileLog(str(path), bag_events(bag, at, topics))
    text, kind = _text_log(path, topics)
    return _FileLog(text.path, partial(_text_events, text, kind, at))


def read_odometry(
    path: str | Path, topics: Topics | None = None, robot: int | None = None
) -> Iterator[Event]:
    """What tells the odometry of such a log, once: of a bag without the scans, of text all events.

    Where the lasers sit need not be known, and is not checked. Raises as `read_log`.
    """
    if is_mrclam(path) or robot is not None:
        return iter(read_log(path, None, topics, robot))
    if (bag := find_bag(path)) is not None:
        events = bag_odometry(bag, topics)
    else:
        text, kind = _text_log(path, topics)
        events = partial(kind.events, text)
    return (event for event in events(Counter()) if _unusable(event) is None)


Change = Callable[[Iterator[Event], Skipped], Iterator[Event]]
"""What is made of a log's events before any is left out; it counts what it leaves out itself."""


def changed(log: Log, change: Change) -> Log:
    """A log that `read_log` gave, with a change made to its events, such as to add what was
    recorded beside it.
    """
    assert isinstance(log, _FileLog)
    events = log.events
    return _FileLog(log.path, lambda skipped: change(events(skipped), skipped))


def _text_log(path: str | Path, topics: Topics | None) -> tuple[TextFile, Format]:
    text = TextFile(str(path), LogError)
    lines = [line.split() for line in text.head()]
    for candidate in FORMATS:
        if any(candidate.recognizes(words) for words in lines if words):
            if topics:
                raise ConfigError(f"{path}: topics are of ROS bags; this is {candidate.name}")
            return text, candidate
    known = ", ".join(known.name for known in FORMATS)
    raise LogError(
        f"{path}: not a log that can be read; known formats: {known}, ROS bags, MRCLAM folders"
    )


@dataclass(eq=False)
class _FileLog:
    """A Log that reads its file anew each time; see mcloc.events.Log.

    Events with a stamp, odometry or mount that is not finite, or odometry beyond FAR, and scans
    without beams, are skipped and counted. Raises LogError at the end where no scan had a single
    return.
    """

    path: str
    events: Callable[[Skipped], Iterator[Event]]
    skipped: dict[str, int] = field(default_factory=dict)

    def __iter__(self) -> Iterator[Event]:
        skipped: Skipped = Counter()
        self.skipped = skipped
        useful = False
        for event in self.events(skipped):
            if reason := _unusable(event):
                skipped[reason] += 1
                continue
            useful = useful or (not isinstance(event, Odometry) and event.useful)
            yield event
        if not useful:
            raise LogError(
                f"{self.path}: holds no scan with a return to localize with, and nothing else that "
                f"was measured and is to be used (skipped: {dict(skipped) or 'nothing'})"
            )


def _unusable(event: Event) -> str | None:
    if not np.isfinite(event.t):
        return "stamp not finite"
    odometry = event.pose if isinstance(event, Odometry) else event.odometry
    if odometry is not None:
        if not np.isfinite(odometry).all():
            return "odometry not finite"
        if np.abs(odometry[:2]).max() >= FAR:
            return f"odometry beyond {FAR:g} m"
    if isinstance(event, Odometry):
        return None
    if isinstance(event, Scan) and len(event.ranges) == 0:
        return "scan without beams"
    mount = getattr(event, "mount", np.zeros(3))
    return None if np.isfinite(mount).all() else "mount not finite"


def _text_events(
    text: TextFile, kind: Format, mount: Pose | None, skipped: Skipped
) -> Iterator[Event]:
    """What a text log says, with the given mount or with those that it says itself."""
    mounts: list[Pose] = []
    mounted: str | None = None
    for event in kind.events(text, skipped):
        if isinstance(event, Scan):
            if mount is not None:
                mounted = mounted or event.source
                if event.source != mounted:
                    raise ConfigError(
                        f"{text.path}: the mount is for one laser, there are several: {mounted}, "
                        f"{event.source}; leave it out, or the scans of all but one"
                    )
                event = replace(event, mount=mount)
            elif _unusable(event) is None:
                _keep(text.path, mounts, event.mount)
        yield event


def _keep(path: str, mounts: list[Pose], mount: Pose) -> None:
    """A laser is bolted on; in logs with a corrected pose in its place it seems to wander."""
    if any(np.abs(mount - known).max() <= SAME_MOUNT for known in mounts):
        return
    mounts.append(mount)
    if len(mounts) > MOST_MOUNTS:
        raise LogError(
            f"{path}: the two poses of its scans put the laser at ever new places on the "
            "robot; say where it sits with --mount X,Y,THETA_DEG"
        )


def _checked(mount: ArrayLike | None) -> Pose | None:
    if mount is None:
        return None
    pose = np.array(mount, dtype=np.float64)
    if pose.shape != (3,) or not np.isfinite(pose).all():
        raise ConfigError(f"mount must be x, y, θ of the laser on the robot, got {mount}")
    return pose
