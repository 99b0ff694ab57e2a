"""Ranges to radio beacons, recorded beside a log, as events between its own.

    scan_index,beacon_id,range_m,antenna_x,antenna_y,antenna_z
    0,1,5.171,0.16,0,1.12

scan_index counts the scans of the log from 0; a column t (s) may stand in its place. The antenna's
columns (m ahead, to the left, up, on the robot) may be left out: it is at its origin then. A range
that is empty, not finite or not > 0 is none. A line that is repeated counts once.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mcloc.errors import LogError
from mcloc.events import BeaconRanges, Event, Odometry, Scan
from mcloc.io.messages import Skipped
from mcloc.maps.beacons import Beacons
from mcloc.textfile import TextFile

NEEDED = "beacon_id", "range_m"
ANTENNA = "antenna_x", "antenna_y", "antenna_z"
FARTHEST = 10.0  # m from the robot's centre to its antenna


@dataclass(frozen=True, eq=False)
class BeaconLog:
    """Readings of beacons; those of one moment, by one antenna, are one measurement.

    of_scan: by the scan at which they were made, their stamps unknown. timed: in the order of time.
    left_out: how many readings are in neither, by reason.
    """

    of_scan: Mapping[int, Sequence[BeaconRanges]]
    timed: Sequence[BeaconRanges]
    left_out: Counter[str]

    def among(self, events: Iterator[Event], skipped: Skipped) -> Iterator[Event]:
        """The events of a log with the readings in their places: those at a scan after it, with its
        stamp and odometry; those with a stamp before the first event that is not earlier. Counts in
        `skipped` what has no place.

        Where a log tells odometry with its scans alone, that is passed on as events of its own, for
        readings between scans.
        """
        skipped.update(self.left_out)
        scans, following, wheels = 0, 0, not self.timed
        for event in events:
            while following < len(self.timed) and self.timed[following].t <= event.t:
                yield self.timed[following]
                following += 1
            wheels = wheels or isinstance(event, Odometry)
            yield event
            if isinstance(event, Scan):
                if not wheels and event.odometry is not None:
                    yield Odometry(event.t, event.odometry)
                for reading in self.of_scan.get(scans, ()):
                    yield replace(reading, t=event.t, odometry=event.odometry)
                scans += 1
        yield from self.timed[following:]
        late = (found for k, found in self.of_scan.items() if k >= scans)
        missing = sum(len(reading.beacon) for found in late for reading in found)
        if missing:
            skipped["range at a scan that the log has not"] += missing


def without_scans(events: Iterator[Event], skipped: Skipped) -> Iterator[Event]:
    """The events but for the scans; of a log that tells odometry with its scans alone, that."""
    wheels = False
    for event in events:
        wheels = wheels or isinstance(event, Odometry)
        if not isinstance(event, Scan):
            yield event
        elif not wheels and event.odometry is not None:
            yield Odometry(event.t, event.odometry)


def read_beacon_ranges(path: str | Path, beacons: Beacons) -> BeaconLog:
    """The readings in a CSV file, see above.

    Raises LogError for a file that is missing, unreadable or empty, and, with its line, for a row
    that cannot be.
    """
    text = TextFile(str(path), LogError)
    index = {name: k for k, name in enumerate(beacons.names)}
    found: defaultdict[tuple[float, tuple[float, ...]], list[tuple[int, float]]] = defaultdict(list)
    unknown: Counter[str] = Counter()
    left_out: Counter[str] = Counter()
    before: set[tuple[Hashable, ...]] = set()
    by_scan = False
    for line, row in text.records(NEEDED):
        if "scan_index" not in row and "t" not in row:
            raise text.fault(line, "when was it? The header must name scan_index, or t in s")
        if "scan_index" in row and "t" in row:
            raise text.fault(line, "the header names scan_index and t: leave one of them out")
        by_scan = "scan_index" in row
        moment = _scan(text, line, row) if by_scan else text.number(line, "t", row["t"])
        antenna, r = _antenna(text, line, row), _range(text, line, row["range_m"])
        reading = moment, antenna, row["beacon_id"], str(r)  # as text NaN equals NaN
        if reading in before:
            left_out[f"duplicate {BeaconRanges.called}"] += 1
            continue
        before.add(reading)
        if row["beacon_id"] in index:
            found[moment, antenna].append((index[row["beacon_id"]], r))
        else:
            unknown[row["beacon_id"]] += 1
    if not found:
        raise LogError(
            f"{path}: holds no range to a beacon of {beacons.name}, which has "
            f"{', '.join(beacons.names)}; ranges to others: {dict(unknown) or 'none'}"
        )
    left_out.update({f"range to unknown beacon {k}": n for k, n in unknown.items()})
    of_scan: defaultdict[int, list[BeaconRanges]] = defaultdict(list)
    timed: list[BeaconRanges] = []
    sources: dict[tuple[float, ...], str] = {}
    for (moment, antenna), readings in found.items():
        numbers, ranges = zip(*readings, strict=True)
        at = math.nan if by_scan else moment
        # Of two measurements of one source with one stamp the second would be taken for the first.
        source = sources.setdefault(antenna, f"beacons by antenna {len(sources)}")
        measured = BeaconRanges(
            at, np.array(numbers), np.array(ranges), np.array(antenna), source=source
        )
        (of_scan[int(moment)] if by_scan else timed).append(measured)
    return BeaconLog(of_scan, sorted(timed, key=lambda measured: measured.t), left_out)


def write_beacon_ranges(
    path: str | Path, beacons: Beacons, readings: Iterable[BeaconRanges]
) -> None:
    """Write readings by their stamps, as `read_beacon_ranges` reads them. Raises LogError where
    nothing can be written.
    """
    lines = [",".join(("t", *NEEDED, *ANTENNA))]
    for reading in readings:
        antenna = ",".join(f"{v:g}" for v in reading.antenna.tolist())
        ranges = (f"{r:.3f}" if np.isfinite(r) else "" for r in reading.range.tolist())
        for beacon, r in zip(reading.beacon.tolist(), ranges, strict=True):
            lines.append(f"{reading.t:.6f},{beacons.names[beacon]},{r},{antenna}")
    try:
        Path(path).write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    except OSError as cause:
        raise LogError(f"{path}: cannot be written to ({cause.strerror})") from cause


def _range(text: TextFile, line: int, field: str) -> float:
    try:
        return float(field) if field else math.nan
    except ValueError:
        raise text.fault(line, f"range_m must be a number of metres, got {field!r}") from None


def _scan(text: TextFile, line: int, row: Mapping[str, str]) -> int:
    field = row["scan_index"]
    number = text.number(line, "scan_index", field)
    if number < 0 or number != int(number):
        raise text.fault(
            line, f"scan_index must be a whole number from 0 on, got {field!r}; or give t in s"
        )
    return int(number)


def _antenna(text: TextFile, line: int, row: Mapping[str, str]) -> tuple[float, ...]:
    return tuple(
        text.number(line, name, row[name], FARTHEST) if name in row else 0.0 for name in ANTENNA
    )
