"""A simulated drive: what it reports, and that its files say the same."""

from itertools import pairwise
from pathlib import Path

import numpy as np

from mcloc.events import Odometry, Scan
from mcloc.geometry import compose
from mcloc.io.log import read_log
from mcloc.io.tum import read_trajectory
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation import SimulatedDrive, office_drive, ranges, write_drive


def test_events_come_in_order_at_their_rates(drive: SimulatedDrive) -> None:
    assert all(a.t < b.t for a, b in pairwise(drive.events))
    for kind, period in ((Odometry, 0.1), (Scan, 0.2)):
        t = np.array([event.t for event in drive.events if isinstance(event, kind)])
        np.testing.assert_allclose(np.diff(t), period)


def test_a_scan_is_what_can_be_seen_from_the_laser_not_from_the_robot(
    drive: SimulatedDrive,
) -> None:
    scans = [event for event in drive.events if isinstance(event, Scan)]
    laser = compose(drive.truth.at(np.array([scan.t for scan in scans])), scans[0].mount)
    exact = ranges(drive.grid, laser, scans[0].angles, scans[0].range_max)
    measured = np.array([scan.ranges for scan in scans])
    returned = np.isfinite(measured)
    assert np.hypot(*scans[0].mount[:2]) > 0.1
    # 6 σ: once in 500 million beams.
    assert np.abs(measured[returned] - exact[returned]).max() < 6 * 0.02


def test_wheels_drift_away_from_the_truth(drive: SimulatedDrive) -> None:
    last = next(event for event in reversed(drive.events) if isinstance(event, Odometry))
    believed = compose(drive.truth.poses[0], last.pose)
    assert np.hypot(*(believed - drive.truth.at(np.array([last.t]))[0])[:2]) > 0.1


def test_the_seed_is_the_drive() -> None:
    first, again, other = (office_drive(seed, length=3.0) for seed in (1, 1, 2))
    for a, b in zip(first.events, again.events, strict=True):
        assert type(a) is type(b)
        assert a.t == b.t
        if isinstance(a, Scan) and isinstance(b, Scan):
            np.testing.assert_array_equal(a.ranges, b.ranges)
    assert not np.array_equal(first.truth.poses[0], other.truth.poses[0])


def test_the_files_hold_what_was_simulated(drive: SimulatedDrive, tmp_path: Path) -> None:
    write_drive(drive, tmp_path)

    grid = OccupancyGrid.load(tmp_path / "map.yaml")
    np.testing.assert_array_equal(grid.occupied, drive.grid.occupied)
    np.testing.assert_array_equal(grid.free, drive.grid.free)
    np.testing.assert_allclose(grid.origin, drive.grid.origin)

    truth = read_trajectory(tmp_path / "truth.csv")
    np.testing.assert_allclose(truth.poses, drive.truth.at(truth.t), atol=1e-5)

    log = read_log(tmp_path / "log.gz")
    for read, simulated in zip(log, drive.events, strict=True):
        assert abs(read.t - simulated.t) < 1e-6
        if isinstance(simulated, Odometry):
            assert isinstance(read, Odometry)
            np.testing.assert_allclose(read.pose, simulated.pose, atol=1e-6)
        else:
            assert isinstance(read, Scan)
            assert read.range_max == simulated.range_max
            returned = np.isfinite(simulated.ranges)
            np.testing.assert_allclose(
                read.ranges[returned], simulated.ranges[returned], atol=0.000501
            )
            assert (read.ranges[~returned] >= read.range_max).all()
            np.testing.assert_allclose(read.angles, simulated.angles)
            np.testing.assert_allclose(read.mount, simulated.mount, atol=1e-5)
            np.testing.assert_allclose(read.odometry, simulated.odometry, atol=1e-6)
    assert log.skipped == {}


def test_writing_again_gives_the_same_bytes(drive: SimulatedDrive, tmp_path: Path) -> None:
    for folder in ("a", "b"):
        write_drive(drive, tmp_path / folder)
    names = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert names == ["log.gz", "map.pgm", "map.yaml", "truth.csv"]
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
