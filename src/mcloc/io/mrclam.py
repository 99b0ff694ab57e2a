"""Folders of the UTIAS MRCLAM dataset: robots that see landmarks, and each other, by their barcodes
[Leung, Halpern, Barfoot, Liu: The UTIAS multi-robot cooperative localization and mapping dataset,
IJRR 2011].

    Barcodes.dat              subject barcode
    Landmark_Groundtruth.dat  subject x y sd_x sd_y
    RobotN_Odometry.dat       t v ω
    RobotN_Measurement.dat    t barcode range bearing
    RobotN_Groundtruth.dat    t x y θ

Metres, radians, seconds; `#` begins a comment. A velocity holds until the next one, but not for
more than LEAP: in between the robot drives an arc. The first odometry pose is 0, 0, 0.
"""

import heapq
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from pathlib import Path

import numpy as np

from mcloc.density import FAR
from mcloc.errors import ConfigError, LogError, MapError, McLocError, TruthError
from mcloc.events import Detection, Event, Odometry, Sightings
from mcloc.geometry import Pose, wrap
from mcloc.io.in_time import LEAP, Row, in_time
from mcloc.io.messages import Skipped
from mcloc.maps.landmarks import Landmarks
from mcloc.textfile import TextFile
from mcloc.trajectory import Trajectory

BARCODES, LANDMARKS = "Barcodes.dat", "Landmark_Groundtruth.dat"
ROBOTS = 5  # subjects 1 … 5 are robots, in all of these folders
_NAME = re.compile(r"Robot(\d+)_Odometry\.dat")


def is_mrclam(path: str | Path) -> bool:
    """Whether there is such a folder."""
    try:
        return (Path(path) / BARCODES).is_file()
    except (OSError, ValueError):
        return False


def robots_in(path: str | Path) -> list[int]:
    """The robots whose odometry is in a folder. Raises LogError where it cannot be read."""
    try:
        names = [_NAME.fullmatch(file.name) for file in Path(path).iterdir()]
    except OSError as cause:
        raise LogError(f"{path}: cannot be opened ({cause.strerror})") from cause
    return sorted(int(name[1]) for name in names if name)


@dataclass(frozen=True)
class Mrclam:
    """What one robot reported, and the landmarks and the truth about it. robot: its number.

    Raises ConfigError where the folder has no such robot, or none was named.
    """

    folder: str
    robot: int | None

    def __post_init__(self) -> None:
        robots = robots_in(self.folder)
        if self.robot not in robots:
            known = ", ".join(map(str, robots)) or "none"
            asked = "which robot?" if self.robot is None else f"there is no robot {self.robot}:"
            raise ConfigError(
                f"{self.folder}: {asked} Its robots are {known}; give one with --robot"
            )

    @cached_property
    def landmarks(self) -> Landmarks:
        """Named by their subjects. Raises MapError for a file that is missing, cut or damaged."""
        rows = [row for _, row in self._rows(LANDMARKS, "subject x y sd_x sd_y", MapError)]
        table = np.array(rows).reshape(-1, 5)
        path = str(Path(self.folder) / LANDMARKS)
        return Landmarks([f"{subject:g}" for subject in table[:, 0]], table[:, 1:3], path)

    @cached_property
    def truth(self) -> Trajectory | None:
        """By motion capture; where it lost the robot, there are no poses. None without a file of
        it. Raises TruthError for one that is cut or damaged, or holds poses that are none.
        """
        name = f"Robot{self.robot}_Groundtruth.dat"
        if not (Path(self.folder) / name).exists():
            return None
        text = self._text(name, TruthError)
        rows = []
        for number, row in self._rows(name, "t x y θ", TruthError):
            if not (all(map(math.isfinite, row)) and max(abs(row[1]), abs(row[2])) < FAR):
                raise text.fault(
                    number, "stamp and pose must be finite numbers; leave the line out"
                )
            rows.append(row)
        if not rows:
            raise TruthError(f"{text.path}: holds no poses; without the file there is no truth")
        table = np.array(rows)
        t, first = np.unique(table[:, 0], return_index=True)
        poses = table[first, 1:]
        poses[:, 2] = wrap(poses[:, 2])
        return Trajectory(t, poses)

    def events(self, mount: Pose, skipped: Skipped) -> Iterator[Event]:
        """Odometry and sightings in order of time. mount: (3,) of the camera. skipped: counts
        sightings of other robots and of unknown barcodes.
        """
        sightings = self._sightings(mount, skipped)
        return heapq.merge(self.odometry(skipped), sightings, key=lambda event: event.t)

    def team_events(self, mount: Pose, landmarks: bool) -> Iterator[Event | Detection]:
        """Odometry, other robots that it saw, which are named by their numbers, and landmarks if
        they are asked for; in order of time.
        """
        uncounted: Skipped = Counter()
        streams: list[Iterator[Event | Detection]] = [
            self.odometry(uncounted),
            self._detections(mount, uncounted),
        ]
        if landmarks:
            streams.append(self._sightings(mount, uncounted))
        return heapq.merge(*streams, key=lambda event: event.t)

    def odometry(self, skipped: Skipped) -> Iterator[Odometry]:
        """One event for each stamp; of velocities with one stamp the last one holds."""
        pose = x, y, theta = 0.0, 0.0, 0.0
        before, v, omega = math.nan, 0.0, 0.0
        rows = self._rows(f"Robot{self.robot}_Odometry.dat", "t v ω", LogError)
        for _, (t, *velocity) in in_time(rows, "odometry", skipped):
            if not all(map(math.isfinite, (t, *velocity))):
                yield Odometry(t, np.full(3, math.nan))
                continue
            if t > before:  # not at the first one, where it is NaN
                held = min(t - before, LEAP)
                length, turn = v * held, omega * held
                chord = length * (math.sin(0.5 * turn) / (0.5 * turn) if turn else 1.0)
                x += chord * math.cos(theta + 0.5 * turn)
                y += chord * math.sin(theta + 0.5 * turn)
                theta = math.remainder(theta + turn, math.tau)
                pose = x, y, theta
            if t != before:
                yield Odometry(t, np.array(pose))
            if not t < before:
                before, (v, omega) = t, velocity

    def _detections(self, mount: Pose, skipped: Skipped) -> Iterator[Detection]:
        """One event for each robot that was seen at a stamp."""
        robots = {
            barcode: f"{subject:g}"
            for barcode, subject in self._subject_of_barcode.items()
            if self._is_robot(subject)
        }
        for t, together in self._measured("detection", skipped):
            for barcode, r, b in together:
                if barcode in robots:
                    yield Detection(t, robots[barcode], r, b, mount=mount)

    def _sightings(self, mount: Pose, skipped: Skipped) -> Iterator[Sightings]:
        """One event for each stamp at which a landmark was seen."""
        landmarks = self._landmark_of_barcode
        for t, together in self._measured("sighting", skipped):
            seen = []
            for barcode, r, bearing in together:
                landmark = landmarks.get(barcode, "sighting of an unknown barcode")
                if isinstance(landmark, str):
                    skipped[landmark] += 1
                else:
                    seen.append((landmark, r, bearing))
            if seen:
                which, ranges, bearings = np.array(seen).T
                yield Sightings(t, which.astype(np.intp), ranges, bearings, mount)

    def _measured(self, what: str, skipped: Skipped) -> Iterator[tuple[float, list[list[float]]]]:
        """Each stamp, and barcode, range and bearing of what was seen then; a line that is repeated
        counts once.
        """
        name = f"Robot{self.robot}_Measurement.dat"
        rows = in_time(self._rows(name, "t barcode range bearing", LogError), what, skipped)
        for t, together in groupby(rows, key=lambda row: row[1][0]):
            every = [row[1:] for _, row in together]
            once = {str(row): row for row in every}  # as text NaN equals NaN
            if len(once) < len(every):
                skipped[f"duplicate {what}"] += len(every) - len(once)
            yield t, list(once.values())

    @cached_property
    def _landmark_of_barcode(self) -> Mapping[float, int | str]:
        """{barcode: index of its landmark, or why it is none}."""
        found: dict[float, int | str] = {}
        for barcode, subject in self._subject_of_barcode.items():
            robot = self._is_robot(subject)
            other = "another robot" if robot else "a landmark whose place is not known"
            found[barcode] = self._index.get(subject, f"sighting of {other}")
        return found

    @cached_property
    def _subject_of_barcode(self) -> Mapping[float, float]:
        text, found = self._text(BARCODES, LogError), dict[float, float]()
        for number, (subject, barcode) in self._rows(BARCODES, "subject barcode", LogError):
            if barcode in found:
                raise text.fault(
                    number, f"barcode {barcode:g} is that of two subjects; leave one of them out"
                )
            found[barcode] = subject
        return found

    @cached_property
    def _index(self) -> Mapping[float, int]:
        """Of each landmark by its subject."""
        return {float(name): k for k, name in enumerate(self.landmarks.names)}

    def _is_robot(self, subject: float) -> bool:
        return subject <= ROBOTS and subject not in self._index

    def _text(self, name: str, error: type[McLocError]) -> TextFile:
        return TextFile(str(Path(self.folder) / name), error)

    def _rows(self, name: str, columns: str, error: type[McLocError]) -> Iterator[Row]:
        """Number and fields of each line."""
        text, n = self._text(name, error), len(columns.split())
        for number, line in text.lines():
            fields = line.split("#", 1)[0].split()
            if not fields:
                continue
            if len(fields) != n:
                raise text.fault(
                    number,
                    f"{n} numbers expected, {columns}, {len(fields)} found; the line is cut or "
                    "damaged: copy the file anew, or leave the line out",
                )
            try:
                yield number, [float(field) for field in fields]
            except ValueError as cause:
                raise text.fault(number, f"{columns} must be numbers ({cause})") from cause
