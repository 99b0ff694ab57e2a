"""What is in a log, gathered event by event in bounded memory, and what looks wrong."""

from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcloc.events import Event, Odometry, Scan, Sightings
from mcloc.inspection.consistency import Comparison, Consistency, verdict
from mcloc.inspection.fault_findings import tell
from mcloc.inspection.faults import MIRRORED, TURNED, Fault
from mcloc.inspection.finding import Finding
from mcloc.inspection.path import Path
from mcloc.inspection.readings import Readings, inspect_readings
from mcloc.inspection.sightings import SightingsInspection, inspect_sightings
from mcloc.inspection.stamps import Stamps, inspect_overlap, inspect_stamps
from mcloc.inspection.windows import Windows
from mcloc.localizer.odometry_buffer import OdometryBuffer

WAITING = 100  # scans that may wait for odometry; more, and the two clocks have nothing in common


class LaserInspection:
    """One laser of the robot, scan by scan.

    scan: the last one. stamps, readings, consistency: of all of them.
    """

    def __init__(self, scan: Scan) -> None:
        self.scan = scan
        self.stamps = Stamps()
        self.readings = Readings()
        self.consistency = Consistency()

    def add(self, scan: Scan) -> None:
        """The next scan, as the log has it."""
        self.scan = scan
        self.stamps.add(scan.t)
        self.readings.add(scan)


class LogInspection:
    """Everything that is said about one log.

    lasers: by name. odometry: the stamps of its events. sightings: of landmarks. path: by the poses
    that scans carry, or where they carry none, by the odometry's. windows: of the first laser, for
    a look at the map.
    """

    def __init__(self) -> None:
        self.lasers: dict[str, LaserInspection] = {}
        self.odometry = Stamps()
        self.sightings = SightingsInspection()
        self.windows = Windows()
        self._by_scans, self._by_wheels = Path(), Path()
        self._buffer = OdometryBuffer(Counter())
        self._waiting: deque[Scan] = deque(maxlen=WAITING)
        self._comparisons: dict[str, list[Comparison]] | None = None

    def watch(self, events: Iterable[Event]) -> Iterator[Event]:
        """The events, noted as they pass."""
        for event in events:
            with np.errstate(over="ignore", invalid="ignore"):  # a damaged log may hold any number
                if isinstance(event, Odometry):
                    self._wheels(event)
                elif isinstance(event, Scan):
                    self._scan(event)
                elif isinstance(event, Sightings):
                    self.sightings.add(event)
            yield event

    @property
    def path(self) -> Path:
        return self._by_scans if self._by_scans.count else self._by_wheels

    def findings(self) -> list[Finding]:
        """What looks wrong, by the log alone."""
        found = inspect_stamps("odometry", self.odometry)
        for name, laser in self.lasers.items():
            found += self._of_laser(name, laser)
        found += inspect_sightings(self.odometry, self.sightings)
        return [f for k, f in enumerate(found) if not _said(f, found[:k])]

    def _of_laser(self, name: str, laser: LaserInspection) -> list[Finding]:
        found = inspect_stamps(name, laser.stamps)
        if (apart := inspect_overlap(self.odometry, name, laser.stamps)) is not None:
            found.append(apart)
        readings = inspect_readings(name, laser.readings)
        believed = verdict(self.comparisons[name])
        if believed is None or any(f.check == "ranges-unit" for f in readings):
            return found + readings
        return [*found, *readings, tell(name, believed, laser.scan.mount, self.path)]

    @property
    def comparisons(self) -> dict[str, list[Comparison]]:
        """By laser: faults of the laser or the odometry against what the log states."""
        if self._comparisons is None:
            self._comparisons = {
                name: laser.consistency.compare() for name, laser in self.lasers.items()
            }
        return self._comparisons

    def open_faults(self) -> list[Fault]:
        """Faults of the first laser that its scans and the odometry do not rule out."""
        first = next(iter(self.comparisons.values()), [])
        return [c.fault for c in first if c.fault in (*TURNED, *MIRRORED) and not c.rejected]

    def _wheels(self, event: Odometry) -> None:
        self.odometry.add(event.t)
        self._by_wheels.add(event.pose)
        self._buffer.add(event)
        while self._waiting and self._buffer.reaches(self._waiting[0].t):
            scan = self._waiting.popleft()
            at = self._buffer.at(scan.t)
            if at is not None:
                self._posed(replace(scan, odometry=at))

    def _scan(self, scan: Scan) -> None:
        laser = self.lasers.setdefault(scan.source, LaserInspection(scan))
        laser.add(scan)
        if scan.odometry is not None:
            self._by_scans.add(scan.odometry)
            self._posed(scan)
        else:
            self._waiting.append(scan)

    def _posed(self, scan: Scan) -> None:
        """A scan with its odometry."""
        self.lasers[scan.source].consistency.add(scan)
        if scan.source == next(iter(self.lasers)):
            self.windows.add(scan)


def _said(finding: Finding, before: list[Finding]) -> bool:
    """Each laser may find the same fault of the odometry."""
    return any((f.check, f.about) == (finding.check, finding.about) for f in before)


def describe_log(log: LogInspection, landmarks: Sequence[str] = ()) -> dict[str, Any]:
    """In numbers: seconds, metres, radians; None where unknown. landmarks: the names of those that
    are known. The log has at least one event.
    """
    path = log.path
    streams = [log.odometry, log.sightings.stamps, *(x.stamps for x in log.lasers.values())]
    start = min(stamps.first for stamps in streams)
    end = max(stamps.last for stamps in streams)
    return {
        "start_s": start,
        "end_s": end,
        "duration_s": _finite(end - start),
        "distance_m": _finite(path.length) if path.count else None,
        "backward_m": _finite(path.backward) if path.count else None,
        "odometry": describe_stream(log.odometry) if log.odometry.count else None,
        "lasers": {name: _laser(laser) for name, laser in log.lasers.items()},
        "sightings": _sightings(log.sightings, landmarks) if landmarks else None,
    }


def describe_stream(stamps: Stamps) -> dict[str, Any]:
    """How many events, how many a second on average, and the longest time without one."""
    steps, duration = stamps.count - 1, stamps.duration
    return {
        "events": stamps.count,
        "rate_hz": _finite(steps / duration) if duration > 0.0 else None,
        "longest_gap_s": _finite(stamps.longest_gap),
    }


def _sightings(seen: SightingsInspection, landmarks: Sequence[str]) -> dict[str, Any]:
    """Of each landmark that is known by its name."""
    of = {name: seen.of[k] for k, name in enumerate(landmarks)}
    return {
        **describe_stream(seen.stamps),
        "sightings": sum(of.values()),
        "of_landmark": of,
        "range_median_m": _finite(seen.median),
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _laser(laser: LaserInspection) -> dict[str, Any]:
    scan, readings = laser.scan, laser.readings
    ends = float(scan.angles.min()), float(scan.angles.max())
    return {
        **describe_stream(laser.stamps),
        "beams": len(scan.ranges),
        "angles_rad": list(ends),
        "range_min_m": readings.range_min,
        "range_max_m": _finite(readings.range_max),
        "range_median_m": _finite(readings.median),
        "missing": readings.missing,
        "missing_by_kind": {k: n / readings.total for k, n in readings.kinds.most_common()},
        "mount": dict(zip(("x", "y", "theta"), map(float, scan.mount), strict=True)),
        "own_odometry": scan.odometry is not None,
    }
