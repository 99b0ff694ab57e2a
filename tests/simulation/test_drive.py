"""A simulated drive: what it reports, and that its files say the same."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from mcloc.errors import ConfigError
from mcloc.evaluation.kidnapping import find_kidnappings
from mcloc.events import Odometry, Scan
from mcloc.geometry import between, compose
from mcloc.io.log import read_log
from mcloc.io.tum import read_trajectory
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation import (
    Laser,
    Scenario,
    SimulatedDrive,
    Wheels,
    evenly,
    office_drive,
    office_world,
    ranges,
    simulate,
    write_drive,
)
from mcloc.simulation.drive import SPEED
from mcloc.simulation.robot import STEP
from mcloc.trajectory import Trajectory

EVENTFUL = Scenario(
    length=8.0,
    people=6,
    glass=0.2,
    kidnap_at=(5.0,),
    wheels=Wheels(slip=0.1),
    lasers=(Laser(source="front"), Laser(source="rear", mount=(-0.2, 0.0, np.pi))),
)


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
    assert len(first.events) == len(again.events)
    for a, b in zip(first.events, again.events, strict=True):
        assert a.t == b.t
        if isinstance(a, Scan) and isinstance(b, Scan):
            np.testing.assert_array_equal(a.ranges, b.ranges)
    assert not np.array_equal(first.truth.poses[0], other.truth.poses[0])


def test_all_that_can_happen_gives_the_same_bytes_again(tmp_path: Path) -> None:
    for folder in "ab":
        write_drive(simulate(office_world(3), 3, EVENTFUL), tmp_path / folder)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


def test_people_and_glass_do_not_change_the_route_or_the_wheels() -> None:
    plain = office_drive(5, length=10.0)
    scenario = Scenario(length=10.0, people=5, glass=0.5)
    eventful = simulate(office_world(5), 5, scenario)
    np.testing.assert_array_equal(plain.truth.poses, eventful.truth.poses)
    assert [e.pose.tolist() for e in plain.events if isinstance(e, Odometry)] == [
        e.pose.tolist() for e in eventful.events if isinstance(e, Odometry)
    ]
    pairs = zip(plain.events, eventful.events, strict=True)
    assert any(
        not np.array_equal(a.ranges, b.ranges)
        for a, b in pairs
        if isinstance(a, Scan) and isinstance(b, Scan)
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_kidnapped_robot_goes_on_elsewhere_and_its_wheels_know_nothing(seed: int) -> None:
    times = (8.02, 20.0)
    scenario = Scenario(length=20.0, kidnap_at=times, wheels=Wheels(0.0, 0.0, 0.0, 0.0, 0.0))
    drive = simulate(office_world(seed), seed, scenario)
    assert len(drive.kidnappings) == 2
    for wanted, found in zip(times, drive.kidnappings, strict=True):
        assert 0.0 <= found - wanted < STEP

    truth = drive.truth
    step = np.hypot(*np.diff(truth.poses[:, :2], axis=0).T)
    jumped = np.isin(truth.t[1:], drive.kidnappings)
    assert jumped.sum() == 2
    assert (step[jumped] > 3.0).all()
    assert step[~jumped].max() <= SPEED * STEP + 1e-12
    assert drive.distance == pytest.approx(20.0, abs=1.0)  # corners are cut, the last step is not

    stamps = np.array([e.t for e in drive.events if isinstance(e, Odometry)])
    wheels = np.array([e.pose for e in drive.events if isinstance(e, Odometry)])
    assert np.hypot(*np.diff(wheels[:, :2], axis=0).T).max() <= SPEED * 0.1 + 1e-9
    for leg in np.split(np.arange(len(stamps)), np.searchsorted(stamps, drive.kidnappings)):
        moved = between(truth.at(stamps[leg[:1]]), truth.at(stamps[leg]))
        np.testing.assert_allclose(between(wheels[leg[0]], wheels[leg]), moved, atol=1e-9)


def test_evaluation_finds_the_kidnapping() -> None:
    scenario = Scenario(length=15.0, kidnap_at=(10.0,))
    drive = simulate(office_world(1), 1, scenario)
    scans = [e for e in drive.events if isinstance(e, Scan)]
    t = np.array([e.t for e in scans])
    wheels = Trajectory(t, np.array([e.odometry for e in scans]))
    (found,) = find_kidnappings(t, drive.truth.at(t), wheels)
    assert t[found.first - 1] < drive.kidnappings[0] <= t[found.first]


def test_kidnappings_in_equal_parts() -> None:
    assert evenly(0, 60.0) == ()
    assert evenly(3, 60.0) == (30.0, 60.0, 90.0)
    drive = simulate(office_world(1), 1, Scenario(length=12.0, kidnap_at=evenly(2, 12.0)))
    assert len(drive.kidnappings) == 2


def test_two_lasers_take_turns_and_look_from_where_they_sit() -> None:
    rear = Laser(source="rear", mount=(-0.2, 0.0, np.pi), beams=91, range_max=30.0, missing=0.0)
    front = Laser(source="front", missing=0.0)
    world = office_world(2)
    drive = simulate(world, 2, Scenario(length=5.0, lasers=(front, rear)))
    scans = [e for e in drive.events if isinstance(e, Scan)]
    assert [scan.source for scan in scans[:4]] == ["front", "rear", "front", "rear"]
    np.testing.assert_allclose(np.diff([scan.t for scan in scans]), 0.1)
    behind = [scan for scan in scans if scan.source == "rear"]
    t = np.array([scan.t for scan in behind])
    exact = ranges(world, compose(drive.truth.at(t), rear.mount), rear.angles, 30.0)
    # 6 σ: once in 500 million beams.
    assert np.abs(np.array([scan.ranges for scan in behind]) - exact).max() < 6 * rear.sigma


def test_glass_that_is_not_in_the_map_is_free_floor_in_it() -> None:
    world = office_world(6)
    scenario = Scenario(length=3.0, glass=0.5, glass_mapped=False)
    mapped = simulate(world, 6, replace(scenario, glass_mapped=True)).grid
    drive = simulate(world, 6, scenario)
    assert mapped is world
    gone = world.occupied & ~drive.grid.occupied
    assert 0.3 < gone.sum() / world.occupied.sum() < 0.7
    assert drive.grid.free[gone].all()
    np.testing.assert_array_equal(drive.grid.cells[~gone], world.cells[~gone])
    assert world.free[world.cell_of(drive.truth.poses)].all()  # it does not drive through glass


@pytest.mark.parametrize(
    "wrong",
    [
        {"length": 0.5},
        {"people": -1},
        {"glass": 2.0},
        {"kidnap_at": (5.0, 5.0)},
        {"kidnap_at": (0.0,)},
        {"kidnap_at": (np.inf,)},
        {"lasers": ()},
        {"lasers": (Laser(), Laser())},
    ],
)
def test_what_cannot_be_right_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match=r"length|people|glass|kidnapping|laser"):
        Scenario(**wrong)  # type: ignore[arg-type]


def test_nobody_is_kidnapped_after_the_end() -> None:
    with pytest.raises(ConfigError, match=r"no kidnapping at 100 s.*ends at"):
        simulate(office_world(0), 0, Scenario(length=10.0, kidnap_at=(100.0,)))


def test_a_seed_is_not_negative() -> None:
    with pytest.raises(ConfigError, match="seed"):
        simulate(office_world(0), -1)


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
