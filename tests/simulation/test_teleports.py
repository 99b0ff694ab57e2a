"""Kidnappings in a log: where, how often and how far, and that nothing else is changed."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import kstest, poisson

from mcloc.errors import ConfigError, LogError, TruthError
from mcloc.evaluation import evaluate
from mcloc.evaluation.kidnapping import find_kidnappings
from mcloc.events import Event, Odometry, Scan
from mcloc.geometry import between, wrap
from mcloc.simulation import (
    Laser,
    Scenario,
    SimulatedDrive,
    Teleported,
    office_world,
    simulate,
    teleported,
)
from mcloc.trajectory import Trajectory

ANGLES = np.linspace(-1.0, 1.0, 3)


@pytest.fixture(scope="module")
def office() -> SimulatedDrive:
    return simulate(office_world(0), 0, Scenario(length=30.0))


def scan_at(t: float, odometry: np.ndarray | None, source: str = "laser") -> Scan:
    return Scan(t, np.array([t, 1.0, 2.0]), ANGLES, 80.0, odometry=odometry, source=source)


def line(n: int = 81, step: float = 0.5) -> tuple[list[Event], Trajectory]:
    """A drive along x, a scan and a reference each second; the wheels' frame is another one."""
    t = 100.0 + np.arange(float(n))
    truth = np.column_stack([step * np.arange(n), np.zeros((n, 2))])
    wheels = np.column_stack([np.full(n, 7.0), step * np.arange(n), np.full(n, np.pi / 2.0)])
    return [scan_at(*each) for each in zip(t, wheels, strict=True)], Trajectory(t, truth)


def scans_of(events: object) -> list[Scan]:
    return [event for event in events if isinstance(event, Scan)]


def sources(drive: Teleported, log: list[Event]) -> np.ndarray:
    """Which scan of the log each scan of the drive is: they share their ranges."""
    index = {id(scan.ranges): k for k, scan in enumerate(scans_of(log))}
    return np.array([index[id(scan.ranges)] for scan in scans_of(drive)])


def odometry_of(scans: list[Scan]) -> np.ndarray:
    return np.array([scan.odometry for scan in scans])


def stamps_of(events: list[Event]) -> np.ndarray:
    return np.array([event.t for event in events])


def test_without_kidnappings_it_is_the_log_itself(office: SimulatedDrive) -> None:
    drive = teleported(office.events, office.truth, seed=1, per_metre=0.0)
    scans = scans_of(office.events)
    within = [e for e in office.events if scans[0].t <= e.t <= scans[-1].t]
    assert drive.kidnappings == ()
    assert [event.t for event in drive] == [event.t for event in within]
    for event, own in zip(drive, within, strict=True):
        if isinstance(event, Odometry):
            assert event.pose == pytest.approx(own.pose, abs=1e-12)
        else:
            assert event.odometry == pytest.approx(own.odometry, abs=1e-12)
            assert replace(event, odometry=own.odometry) == own
    kept = (office.truth.t >= scans[0].t) & (office.truth.t <= scans[-1].t)
    np.testing.assert_array_equal(drive.truth.t, office.truth.t[kept])
    np.testing.assert_array_equal(drive.truth.poses, office.truth.poses[kept])


@pytest.mark.parametrize("seed", range(5))
def test_only_stamps_and_the_frame_of_the_odometry_are_changed(
    office: SimulatedDrive, seed: int
) -> None:
    drive = teleported(office.events, office.truth, seed, per_metre=0.05, length=80.0)
    log, scans = scans_of(office.events), scans_of(drive)
    source = sources(drive, office.events)
    for scan, k in zip(scans, source.tolist(), strict=True):
        assert replace(scan, t=log[k].t, odometry=log[k].odometry) == log[k]

    jumped = np.isin(stamps_of(scans)[1:], drive.kidnappings)
    assert jumped.sum() == len(drive.kidnappings) > 0
    np.testing.assert_array_equal(np.diff(source)[~jumped], 1)
    own = odometry_of(log)
    moved = between(own[source[:-1]], own[source[1:]])
    moved[jumped] = 0.0
    u = between(odometry_of(scans)[:-1], odometry_of(scans)[1:])
    np.testing.assert_allclose(u, moved, atol=1e-9)

    # The stamps of the log to 1e-9 s, its scans 0.2 s apart; one more such step for each jump.
    np.testing.assert_allclose(np.diff(stamps_of(scans)), 0.2, atol=1e-9)
    assert (np.diff(stamps_of(list(drive))) > 0.0).all()


def test_odometry_events_move_with_the_scans(office: SimulatedDrive) -> None:
    drive = teleported(office.events, office.truth, 2, per_metre=0.05, length=80.0)
    cuts = np.searchsorted(stamps_of(list(drive)), drive.kidnappings)
    own = {round(event.t, 6): event for event in office.events}
    for stretch in np.split(np.arange(len(drive.events)), cuts):
        events = [drive.events[k] for k in stretch]
        first = int(sources(Teleported(tuple(events), drive.truth, ()), office.events)[0])
        later = events[0].t - scans_of(office.events)[first].t
        recorded = [own[round(event.t - later, 6)] for event in events]
        assert [type(event) for event in events] == [type(event) for event in recorded]
        told, wheels = (
            np.array([e.pose if isinstance(e, Odometry) else e.odometry for e in some])
            for some in (events, recorded)
        )
        np.testing.assert_allclose(between(told[0], told), between(wheels[0], wheels), atol=1e-9)


def test_scans_without_odometry_of_their_own_get_it_from_the_wheels_between(
    office: SimulatedDrive,
) -> None:
    log = [replace(e, odometry=None) if isinstance(e, Scan) else e for e in office.events]
    drive = teleported(log, office.truth, 1, per_metre=0.05, length=80.0)
    assert len(drive.kidnappings) > 1
    assert all(scan.odometry is None for scan in scans_of(drive))

    def interpolated(events: list[Event]) -> np.ndarray:
        told = [event for event in events if isinstance(event, Odometry)]
        assert (np.diff(stamps_of(told)) > 0.0).all()
        wheels = Trajectory(stamps_of(told), np.array([event.pose for event in told]))
        return wheels.at(stamps_of(scans_of(events)))

    source, own, here = sources(drive, log), interpolated(log), interpolated(list(drive))
    jumped = np.isin(stamps_of(scans_of(drive))[1:], drive.kidnappings)
    moved = between(own[source[:-1]], own[source[1:]])
    moved[jumped] = 0.0
    np.testing.assert_allclose(between(here[:-1], here[1:]), moved, atol=1e-9)

    # What is added is told at both sides of each jump, at the start and at the end, and only there.
    t = stamps_of(scans_of(drive))
    landed = np.searchsorted(t, drive.kidnappings)
    ends = {t[0], t[-1], *t[landed], *t[landed - 1]}
    assert {e.t for e in drive if isinstance(e, Odometry)} & set(t.tolist()) == ends


def test_a_reference_is_where_its_scan_was_made(office: SimulatedDrive) -> None:
    drive = teleported(office.events, office.truth, 3, per_metre=0.05, length=80.0)
    assert (np.diff(drive.truth.t) > 0.0).all()
    t = stamps_of(scans_of(drive))
    own = stamps_of(scans_of(office.events))[sources(drive, office.events)]
    nearest = np.abs(t[:, None] - drive.truth.t).argmin(axis=1)
    assert np.abs(drive.truth.t[nearest] - t).max() < 1e-9
    difference = drive.truth.poses[nearest] - office.truth.at(own)
    difference[:, 2] = wrap(difference[:, 2])
    assert np.abs(difference).max() < 1e-6


@pytest.mark.parametrize("away", [2.0, 10.0])
def test_it_is_carried_far_enough_and_drives_as_the_log_does_elsewhere(
    office: SimulatedDrive, away: float
) -> None:
    drive = teleported(office.events, office.truth, 4, per_metre=0.1, away=away, length=80.0)
    assert len(drive.kidnappings) > 3
    step = np.hypot(*np.diff(drive.truth.poses[:, :2], axis=0).T)
    jumped = np.isin(drive.truth.t[1:], drive.kidnappings)
    assert jumped.sum() == len(drive.kidnappings)
    assert (step[jumped] >= away).all()
    assert step[~jumped].max() <= 0.5 * 0.05 + 1e-9  # 0.5 m/s, a reference each 0.05 s
    assert step[~jumped].sum() == pytest.approx(80.0, abs=0.1)  # to the scan after 80 m


def test_by_default_it_is_as_long_as_the_log(office: SimulatedDrive) -> None:
    drive = teleported(office.events, office.truth, 5, per_metre=0.1)
    step = np.hypot(*np.diff(drive.truth.poses[:, :2], axis=0).T)
    driven = step[~np.isin(drive.truth.t[1:], drive.kidnappings)].sum()
    assert driven == pytest.approx(office.distance, abs=0.2)


def test_where_the_log_ends_it_is_carried_off_too() -> None:
    log, truth = line()
    drive = teleported(log, truth, 1, per_metre=0.0, length=150.0)
    source = sources(drive, log)
    leaving = np.flatnonzero(np.diff(source) != 1)
    assert len(leaving) == len(drive.kidnappings) >= 3
    assert (source[leaving] == 80).all()
    assert not (source[leaving + 1] == 80).any()  # from where nothing would be driven
    driven = np.diff(source)[np.diff(source) == 1].sum() * 0.5
    assert driven == 150.0


def test_evaluation_finds_these_kidnappings_and_no_others(office: SimulatedDrive) -> None:
    drive = teleported(office.events, office.truth, 6, per_metre=0.05, length=100.0)
    assert len(drive.kidnappings) > 2
    scans = scans_of(drive)
    wheels = Trajectory(stamps_of(scans), odometry_of(scans))
    found = evaluate(drive.truth, drive.truth, odometry=wheels, kidnappings=drive.kidnappings)
    assert tuple(recovery.t for recovery in found.recoveries) == drive.kidnappings
    step = np.hypot(*np.diff(drive.truth.poses[:, :2], axis=0).T)
    stretches = np.split(np.append(0.0, step), np.searchsorted(drive.truth.t, drive.kidnappings))
    for recovery, way in zip(found.recoveries, stretches[1:], strict=True):
        assert recovery.path_m == pytest.approx(way[1:].sum())
    by_odometry = find_kidnappings(drive.truth.t, drive.truth.poses, wheels)
    assert tuple(kidnapping.t for kidnapping in by_odometry) == drive.kidnappings


def carried_off(drive: Teleported, log: list[Event]) -> tuple[int, list[int]]:
    """How often before the end of the log, and the moments at which it was put down."""
    source = sources(drive, log)
    jumps = np.flatnonzero(np.isin(stamps_of(scans_of(drive)), drive.kidnappings))
    last = len(scans_of(log)) - 1
    return int((source[jumps - 1] < last).sum()), source[jumps].tolist()


def test_kidnappings_are_as_frequent_as_stated_and_lead_everywhere_alike() -> None:
    """Counts are Poisson, or a little less spread: never two between two scans. Outside these
    bounds once in 10,000 suites on either side."""
    log, truth = line(n=201, step=0.2)
    # A third of the scans are made within 2 cm, and draw the robot no more than any other 2 cm.
    dense = [scan_at(200.0 + 0.001 * k, np.zeros(3)) for k in range(1, 100)]
    log = sorted([*log, *dense], key=lambda event: event.t)
    seeds, length, rate = 200, 60.0, 0.05
    count, landed = 0, []
    for seed in range(seeds):
        drive = teleported(log, truth, seed, per_metre=rate, away=0.0, length=length)
        often, places = carried_off(drive, log)
        count += often
        landed += [truth.at(np.array([scans_of(log)[k].t]))[0, 0] for k in places]
    least, most = poisson.ppf([1e-4, 1.0 - 1e-4], seeds * length * rate)
    assert least <= count <= most
    jitter = np.random.default_rng(1).uniform(0.0, 0.2, len(landed))  # to the next moment
    assert kstest((np.array(landed) + jitter) / 40.0, "uniform").pvalue > 1e-4


def test_distances_between_kidnappings_are_exponential() -> None:
    log, truth = line(n=4001, step=0.1)
    drive = teleported(log, truth, 7, per_metre=0.1, length=8000.0, away=1.0)
    source = sources(drive, log)
    cuts = np.flatnonzero(np.isin(stamps_of(scans_of(drive)), drive.kidnappings))
    stretches = np.split(source, cuts)[:-1]
    driven = np.array([0.1 * (s[-1] - s[0]) for s in stretches if s[-1] < 4000])
    jitter = np.random.default_rng(2).uniform(-0.1, 0.0, len(driven))  # rounded up to a scan
    assert len(driven) > 500
    assert kstest(driven + jitter, "expon", args=(0.0, 10.0)).pvalue > 1e-4


def test_the_same_seed_gives_the_same_bytes_and_another_one_others(
    office: SimulatedDrive,
) -> None:
    def content(seed: int) -> bytes:
        drive = teleported(office.events, office.truth, seed, per_metre=0.1, length=50.0)
        rows = [
            [event.t, *(event.pose if isinstance(event, Odometry) else event.odometry)]
            for event in drive
        ]
        ranges = np.concatenate([scan.ranges for scan in scans_of(drive)])
        tables = (np.array(rows), ranges, drive.truth.t, drive.truth.poses, drive.kidnappings)
        return b"".join(np.array(table).tobytes() for table in tables)

    assert content(1) == content(1)
    assert content(1) != content(2)


def test_it_can_be_read_again_and_again_as_a_log(office: SimulatedDrive) -> None:
    drive = teleported(office.events, office.truth, 1)
    assert list(drive) == list(drive) == list(drive.events)
    assert drive.skipped == {}
    assert isinstance(drive.path, str)


def test_it_starts_at_the_first_scan_that_the_truth_covers() -> None:
    log, truth = line()
    later = Trajectory(truth.t[10:] + 0.0004, truth.poses[10:])
    drive = teleported(log, later, 1, per_metre=0.0)
    assert drive.events[0].t == 110.0
    assert drive.truth.t[0] == pytest.approx(110.0004)
    assert drive.events[-1].t == 180.0


def test_the_log_is_taken_in_the_order_of_its_stamps() -> None:
    log, truth = line()
    order = np.random.default_rng(1).permutation(len(log))
    shuffled = teleported([log[k] for k in order], truth, 8, per_metre=0.05, length=100.0)
    sorted_ = teleported(log, truth, 8, per_metre=0.05, length=100.0)
    assert stamps_of(list(shuffled)).tolist() == stamps_of(list(sorted_)).tolist()
    assert sources(shuffled, log).tolist() == sources(sorted_, log).tolist()


def test_coarse_stamps_stay_as_they_are() -> None:
    log, truth = line()
    coarse = [replace(scan, t=np.floor(scan.t / 2.0) * 2.0) for scan in log]
    drive = teleported(coarse, truth, 9, per_metre=0.05, length=100.0)
    assert len(drive.kidnappings) > 2
    t, source = stamps_of(list(drive)), sources(drive, coarse)
    gone = np.diff(source) == 1
    own = stamps_of(coarse)
    np.testing.assert_allclose(np.diff(t)[gone], (own[source[1:]] - own[source[:-1]])[gone])
    np.testing.assert_allclose(np.diff(t)[~gone], 2.0)  # the median of those that are not 0
    assert (np.diff(drive.truth.t) > 0.0).all()


def test_the_scan_interval_is_that_of_one_laser() -> None:
    scenario = Scenario(length=20.0, lasers=(Laser(source="front"), Laser(source="rear")))
    two = simulate(office_world(1), 1, scenario)
    drive = teleported(two.events, two.truth, 1, per_metre=0.1, length=60.0)
    t = stamps_of(list(drive))
    before = t[np.searchsorted(t, drive.kidnappings) - 1]
    np.testing.assert_allclose(np.array(drive.kidnappings) - before, 0.2)


def test_a_gap_in_the_references_has_no_path_and_nobody_leaves_or_arrives_in_it() -> None:
    log, truth = line()  # 40 m, of which 10 m have no references
    known = (truth.t <= 120.0) | (truth.t >= 140.0)
    gappy = Trajectory(truth.t[known], truth.poses[known])
    whole = teleported(log, gappy, 1, per_metre=0.0)
    assert len(whole.events) == 81  # the robot drives through it all the same
    ended = teleported(log, gappy, 1, per_metre=0.0, length=29.0)
    assert len(ended.events) == 79  # 10 m + 19 m
    for seed in range(20):
        drive = teleported(log, gappy, seed, per_metre=0.2, length=100.0)
        source = sources(drive, log)
        jumps = np.flatnonzero(np.diff(source) != 1)
        for k in (*source[jumps], *source[jumps + 1]):
            assert not 20 < k < 40
        assert not (source[jumps + 1] == 20).any()  # where no known path begins


def test_scans_in_a_gap_are_no_moments_though_a_reference_is_near() -> None:
    _, truth = line()
    known = (truth.t <= 120.0) | (truth.t >= 140.0)
    gappy = Trajectory(truth.t[known], truth.poses[known])
    log = [scan_at(100.3 + 0.4 * k, np.zeros(3)) for k in range(199)]
    for seed in range(50):
        drive = teleported(log, gappy, seed, per_metre=0.5, length=50.0)
        source = sources(drive, log)
        jumps = np.flatnonzero(np.diff(source) != 1)
        for k in (*source[jumps], *source[jumps + 1]):
            assert not 120.0 < log[k].t < 140.0


def test_odometry_that_is_told_at_the_moments_is_not_told_again() -> None:
    scans, truth = line()
    log = [e for s in scans for e in (Odometry(s.t, s.odometry), replace(s, odometry=None))]
    drive = teleported(log, truth, 1, per_metre=0.1, length=100.0)
    assert len(drive.kidnappings) > 2
    told = [event for event in drive if isinstance(event, Odometry)]
    assert len(told) == len(scans_of(drive))
    assert stamps_of(told).tolist() == stamps_of(scans_of(drive)).tolist()
    assert isinstance(drive.events[0], Odometry)  # not only after the first scan


def test_a_kidnapping_of_the_log_itself_stays_and_is_no_path() -> None:
    log, truth = line()
    poses = truth.poses.copy()
    poses[40:, 1] += 30.0
    drive = teleported(log, Trajectory(truth.t, poses), 1, per_metre=0.0)
    assert drive.kidnappings == ()
    assert len(drive.events) == 81


def test_scans_far_from_any_reference_are_no_moments_but_are_driven_by() -> None:
    _, truth = line()
    often = [scan_at(100.0 + k / 10.0, np.zeros(3)) for k in range(801)]
    sparse = Trajectory(truth.t[::4], truth.poses[::4])  # 2 m and 4 s apart
    drive = teleported(often, sparse, 1, per_metre=0.1, length=100.0)
    source = sources(drive, often)
    jumps = np.flatnonzero(np.diff(source) != 1)
    assert len(jumps) == len(drive.kidnappings) > 4
    for k in (*source[jumps], *source[jumps + 1]):
        assert min(k % 40, 40 - k % 40) <= 5


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"seed": -1}, "seed"),
        ({"per_metre": -0.1}, "per_metre"),
        ({"per_metre": 1.0}, "per_metre"),
        ({"per_metre": np.nan}, "per_metre"),
        ({"away": -1.0}, "away"),
        ({"away": np.nan}, "away"),
        ({"away": np.inf}, "away"),
        ({"length": 0.0}, "length"),
        ({"length": np.inf}, "length"),
        ({"length": np.nan}, "length"),
        ({"away": 100.0, "length": 50.0}, "away = 100 m: .* give a smaller one"),
    ],
)
def test_what_cannot_be_is_refused_by_its_name(arguments: dict[str, float], named: str) -> None:
    log, truth = line()
    with pytest.raises(ConfigError, match=named):
        teleported(log, truth, **{"seed": 1, **arguments})


def test_a_truth_of_another_time_is_refused_with_both_spans() -> None:
    log, truth = line()
    other = Trajectory(truth.t + 1000.0, truth.poses)
    with pytest.raises(TruthError, match=r"100\.000 … 180\.000 s .*1100\.000 … 1180\.000 s"):
        teleported(log, other, 1)
    with pytest.raises(TruthError, match=r"nothing \(truth\)"):
        teleported(log, Trajectory(np.empty(0), np.empty((0, 3))), 1)


def test_a_truth_that_stands_still_is_refused() -> None:
    log, truth = line()
    for still in (Trajectory(truth.t, 0.0 * truth.poses), Trajectory(truth.t[:1], truth.poses[:1])):
        with pytest.raises(TruthError, match="does not move"):
            teleported(log, still, 1)


def test_logs_without_scans_or_odometry_are_refused() -> None:
    log, truth = line()
    with pytest.raises(LogError, match="no scans"):
        teleported([Odometry(scan.t, scan.odometry) for scan in scans_of(log)], truth, 1)
    with pytest.raises(LogError, match="no odometry"):
        teleported([replace(scan, odometry=None) for scan in scans_of(log)], truth, 1)
    few = [scan_at(100.0, np.zeros(3), "a"), scan_at(180.0, np.zeros(3), "b")]
    with pytest.raises(LogError, match="two scans"):
        teleported(few, truth, 1, length=100.0)


def test_stamps_never_go_back_nor_come_twice() -> None:
    log, truth = line()
    for seed in range(20):
        drive = teleported(log, truth, seed, per_metre=0.3, length=60.0)
        assert all(a.t < b.t for a, b in pairwise(drive))
