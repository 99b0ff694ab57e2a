"""Ranges recorded beside a log: at its scans or at stamps of their own."""

from collections import Counter

import numpy as np
import pytest

from mcloc.errors import LogError
from mcloc.events import BeaconRanges, Odometry, Scan
from mcloc.io.beacons import read_beacon_ranges, without_scans, write_beacon_ranges
from mcloc.io.log import changed, read_log
from mcloc.localizer.queue import Queue
from mcloc.maps.beacons import Beacons

BEACONS = Beacons(["1", "x2"], np.zeros((2, 3)))


def scan(t, odometry=True):
    pose = np.array([t, 0.0, 0.0]) if odometry else None
    return Scan(t, np.ones(3), np.zeros(3), 8.0, odometry=pose)


def log_of(tmp_path, text):
    file = tmp_path / "ranges.csv"
    file.write_text(text)
    return read_beacon_ranges(file, BEACONS)


def kinds(events):
    return [type(event).__name__[0] + f"{event.t:g}" for event in events]


def test_ranges_of_a_scan_follow_it_as_one_measurement(tmp_path):
    log = log_of(
        tmp_path,
        "scan_index,beacon_id,range_m,antenna_x,antenna_y,antenna_z\n"
        "1,x2,4.5,0.1,0.2,1.5\n0,1,3,0.1,0.2,1.5\n1,1,nan,0.1,0.2,1.5\n5,1,2,0,0,0\n"
        "0,nobody,7,0,0,0\n1,x2,,0,0,0\n",
    )
    skipped = Counter()
    events = list(log.among(iter([scan(10.0), scan(11.5, odometry=False)]), skipped))
    assert kinds(events) == ["S10", "B10", "S11.5", "B11.5", "B11.5"]
    first, second, other = (event for event in events if isinstance(event, BeaconRanges))
    assert first.odometry.tolist() == [10.0, 0.0, 0.0]
    assert second.odometry is None
    assert second.beacon.tolist() == [1, 0]
    assert second.range.tolist() == pytest.approx([4.5, np.nan], nan_ok=True)
    assert second.antenna.tolist() == [0.1, 0.2, 1.5]
    assert other.antenna.tolist() == [0.0, 0.0, 0.0]
    assert not other.useful
    assert skipped == {
        "range to unknown beacon nobody": 1,
        "range at a scan that the log has not": 1,
    }
    assert list(log.among(iter([scan(10.0)]), Counter()))[1].t == 10.0  # once more from the start


def test_ranges_with_stamps_are_put_among_the_events(tmp_path):
    log = log_of(tmp_path, "t,beacon_id,range_m\n4.5,1,2\n0.5,x2,3\n0.5,1,4\n1,1,5\n")
    events = list(log.among(iter([scan(1.0), scan(2.0)]), Counter()))
    # The scans' odometry is passed on, or ranges between them would have none.
    assert kinds(events) == ["B0.5", "B1", "S1", "O1", "S2", "O2", "B4.5"]
    assert events[0].beacon.tolist() == [1, 0]
    wheels = [Odometry(0.0, np.zeros(3)), scan(1.0)]
    assert kinds(log.among(iter(wheels), Counter())) == ["O0", "B0.5", "B1", "S1", "B4.5"]


def test_a_reading_that_is_repeated_counts_once(tmp_path):
    """Other ranges to the same beacon at the same moment count, and so do those by another antenna:
    these are measurements of their own to a localizer, too.
    """
    log = log_of(
        tmp_path,
        "t,beacon_id,range_m,antenna_x\n1,1,2,0\n1,x2,3,0\n1,1,2.0,0\n1,1,2.5,0\n1,1,2,0.3\n"
        "1,1,,0\n1,1,nan,0\n2,1,2,0\n1,x2,3,0\n1,nobody,3,0\n1,nobody,3,0\n",
    )
    skipped = Counter()
    first, other, second = (
        e for e in log.among(iter([scan(3.0)]), skipped) if isinstance(e, BeaconRanges)
    )
    assert first.beacon.tolist() == [0, 1, 0, 0]
    assert first.range.tolist() == pytest.approx([2.0, 3.0, 2.5, np.nan], nan_ok=True)
    assert (other.range.tolist(), other.antenna.tolist()) == ([2.0], [0.3, 0.0, 0.0])
    assert second.t == 2.0
    assert skipped == {"duplicate beacon reading": 4, "range to unknown beacon nobody": 1}
    ignored = Counter()
    queue = Queue(ignored)
    for z in (Odometry(0.0, np.zeros(3)), Odometry(9.0, np.zeros(3))):
        queue.wheels.add(z)
    for z in (first, other, second):
        queue.add(z)
    queue.finish()
    assert [z for z, _ in queue.ready(final=True, until=9.0)] == [first, other, second]
    assert not ignored


def test_without_scans_their_odometry_stays():
    assert kinds(without_scans(iter([scan(1.0), scan(2.0, odometry=False)]), Counter())) == ["O1"]
    both = [Odometry(0.0, np.zeros(3)), scan(1.0), Odometry(2.0, np.zeros(3))]
    assert kinds(without_scans(iter(both), Counter())) == ["O0", "O2"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("scan_index,beacon_id\n0,1\n", "line 1: the header lacks range_m"),
        (
            "beacon_id,range_m\n1,2\n",
            "line 2: when was it\\? The header must name scan_index, or t",
        ),
        ("scan_index,beacon_id,range_m\n0,1\n", "line 2: 3 fields expected, 2 found"),
        ("scan_index,beacon_id,range_m\n0,1,far\n", "line 2: range_m must be a number.*'far'"),
        (
            "scan_index,beacon_id,range_m\n-1,1,2\n",
            "line 2: scan_index must be a whole number from",
        ),
        (
            "scan_index,beacon_id,range_m\n0.5,1,2\n",
            "line 2: scan_index must be a whole number.*t in",
        ),
        ("t,beacon_id,range_m\nnan,1,2\n", "line 2: t must be a finite number"),
        (
            "t,beacon_id,range_m,antenna_z\n1,1,2,99\n",
            "line 2: antenna_z must be a finite.*below 10",
        ),
        (
            "t,beacon_id,range_m\n1,9,2\n",
            "no range to a beacon of beacons, which has 1, x2.*'9': 1",
        ),
    ],
)
def test_rows_that_cannot_be_are_refused_with_their_line(tmp_path, text, message):
    with pytest.raises(LogError, match=message):
        log_of(tmp_path, text)


def test_a_changed_log_counts_its_scans_before_any_is_left_out(tmp_path):
    """A scan without beams is skipped, but it is a scan of the log all the same."""
    (tmp_path / "log").write_text(
        "FLASER 0 0 0 0 0 0 0 1.0 host 1.0\nFLASER 2 1.0 2.0 1 0 0 1 0 0 2.0 host 2.0\n"
    )
    ranges = log_of(tmp_path, "scan_index,beacon_id,range_m\n1,1,2.5\n0,x2,1\n")
    log = changed(read_log(tmp_path / "log"), ranges.among)
    for _ in range(2):
        assert kinds(log) == ["B1", "S2", "B2"]
        assert log.skipped == {"scan without beams": 1}


def test_ranges_are_read_as_they_were_written(tmp_path):
    antenna = np.array([0.1, 0.0, 1.12])
    made = [
        BeaconRanges(0.5, np.array([1, 0]), np.array([3.25, np.nan]), antenna),
        BeaconRanges(1.25, np.array([1]), np.array([4.5]), antenna),
    ]
    write_beacon_ranges(tmp_path / "ranges.csv", BEACONS, made)
    read = read_beacon_ranges(tmp_path / "ranges.csv", BEACONS)
    assert [reading.t for reading in read.timed] == [0.5, 1.25]
    for ours, theirs in zip(made, read.timed, strict=True):
        assert theirs.beacon.tolist() == ours.beacon.tolist()
        assert theirs.range.tolist() == pytest.approx(ours.range.tolist(), nan_ok=True)
        assert theirs.antenna.tolist() == antenna.tolist()


def test_where_ranges_cannot_be_written(tmp_path):
    with pytest.raises(LogError, match="cannot be written"):
        write_beacon_ranges(tmp_path / "nowhere" / "ranges.csv", BEACONS, [])
