"""Recorded logs of any known format, as events in the order of the file."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mcloc.errors import ConfigError, LogError
from mcloc.events import Event, Log, Odometry, Scan
from mcloc.geometry import Pose
from mcloc.io.carmen import CARMEN
from mcloc.io.messages import Format
from mcloc.io.wean import WEAN
from mcloc.textfile import TextFile

FORMATS: tuple[Format, ...] = (CARMEN, WEAN)

MOST_MOUNTS = 4  # lasers on one robot
SAME_MOUNT = 0.05  # m, rad


def read_log(path: str | Path, mount: ArrayLike | None = None) -> Log:
    """The log in a file, gzip or not, its format told by its content.

    mount: (3,) x, y in metres, θ in radians: the laser's pose in the robot's frame, instead of what
    the log says. Raises LogError for a file that is missing, unreadable, empty or no known log;
    ConfigError for a mount that is no pose.
    """
    text = TextFile(str(path), LogError)
    lines = [line.split() for line in text.head()]
    for candidate in FORMATS:
        if any(candidate.recognizes(words) for words in lines if words):
            return _FileLog(text.path, text, candidate, _checked(mount))
    known = ", ".join(known.name for known in FORMATS)
    raise LogError(f"{path}: not a log that can be read; known formats: {known}")


@dataclass(eq=False)
class _FileLog:
    """A Log that reads its file anew each time; see mcloc.events.Log.

    Events with a stamp, odometry or mount that is not finite, and scans without beams, are skipped
    and counted. Raises LogError at the end where no scan had a single return.
    """

    path: str
    text: TextFile
    format: Format
    mount: Pose | None
    skipped: dict[str, int] = field(default_factory=dict)

    def __iter__(self) -> Iterator[Event]:
        skipped: Counter[str] = Counter()
        self.skipped = skipped
        mounts: list[Pose] = []
        useful = False
        for event in self.format.events(self.text, skipped):
            if self.mount is not None and isinstance(event, Scan):
                event = replace(event, mount=self.mount)
            if reason := _unusable(event):
                skipped[reason] += 1
                continue
            if isinstance(event, Scan):
                self._keep(mounts, event.mount)
                useful = useful or bool(event.returned.any())
            yield event
        if not useful:
            raise LogError(
                f"{self.path}: holds no scan with a return to localize with"
                f" (skipped: {dict(skipped) or 'nothing'})"
            )

    def _keep(self, mounts: list[Pose], mount: Pose) -> None:
        """A laser is bolted on; in logs with a corrected pose in its place it seems to wander."""
        if any(np.abs(mount - known).max() <= SAME_MOUNT for known in mounts):
            return
        mounts.append(mount)
        if len(mounts) > MOST_MOUNTS:
            raise LogError(
                f"{self.path}: the two poses of its scans put the laser at ever new places on the "
                "robot; say where it sits with --mount X,Y,THETA_DEG"
            )


def _unusable(event: Event) -> str | None:
    if not np.isfinite(event.t):
        return "stamp not finite"
    if isinstance(event, Odometry):
        return None if np.isfinite(event.pose).all() else "odometry not finite"
    if event.odometry is not None and not np.isfinite(event.odometry).all():
        return "odometry not finite"
    if len(event.ranges) == 0:
        return "scan without beams"
    return None if np.isfinite(event.mount).all() else "mount not finite"


def _checked(mount: ArrayLike | None) -> Pose | None:
    if mount is None:
        return None
    pose = np.array(mount, dtype=np.float64)
    if pose.shape != (3,) or not np.isfinite(pose).all():
        raise ConfigError(f"mount must be x, y, θ of the laser on the robot, got {mount}")
    return pose
