"""What can be asked of a localizer while it runs; several lasers; stamps that cannot be."""

import numpy as np
import pytest

from mcloc.errors import ConfigError
from mcloc.events import Odometry
from mcloc.geometry import between
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid

SURE = np.diag([0.05, 0.05, 0.05]) ** 2
FRONT, REAR = (0.2, 0.0, 0.0), (-0.2, 0.0, np.pi)


# Told a pose


def test_a_pose_that_is_told_moves_the_belief_there(world):
    loc = world.localizer(5000, initial=(4.0, 2.0, -2.0))
    loc.process(world.scan(0.0, world.start, odometry=np.zeros(3)))
    covariance = np.array([[0.04, 0.01, 0.0], [0.01, 0.09, -0.005], [0.0, -0.005, 0.01]])
    loc.set_pose(world.start, covariance)
    x = loc.belief.particles.states
    assert x.mean(axis=1) == pytest.approx(world.start, abs=4.5 * 0.3 / np.sqrt(5000))
    # Deviation of a covariance: √((Σ_ii Σ_jj + Σ_ij²) / N).
    diagonal = np.diag(covariance)
    bound = 4.5 * np.sqrt((np.outer(diagonal, diagonal) + covariance**2) / 5000)
    assert (np.abs(np.cov(x) - covariance) < bound).all()
    # The next scan is used at once, although the robot has not moved.
    (found,) = loc.process(world.scan(1.0, world.start, odometry=np.zeros(3)))
    assert found.updated
    assert found.pose == pytest.approx(world.start, abs=0.1)


def test_a_pose_that_is_told_again_is_drawn_anew(world):
    loc = world.localizer()
    drawn = []
    for _ in range(2):
        loc.set_pose(world.start, SURE)
        drawn.append(loc.belief.particles.states)
    assert not np.array_equal(*drawn)


@pytest.mark.parametrize(
    ("pose", "covariance", "message"),
    [
        ((90.0, 0.0, 0.0), SURE, "outside the map room"),
        ((3.5, 2.0, 0.0), SURE, "inside a wall room"),
        ((1.0, np.nan, 0.0), SURE, "three finite numbers"),
        ((1.0, 1.0, 0.0), np.eye(2), r"the covariance of the pose must be \(3, 3\)"),
        ((1.0, 1.0, 0.0), -np.eye(3), "positive definite"),
        ((1.0, 1.0, 0.0), np.full((3, 3), np.inf), "finite"),
        ((1.0, 1.0, 0.0), np.triu(np.ones((3, 3))) + np.eye(3), "symmetric"),
    ],
)
def test_a_pose_that_cannot_be_changes_nothing(world, pose, covariance, message):
    loc = world.localizer()
    before = loc.belief
    with pytest.raises(ConfigError, match=message):
        loc.set_pose(pose, covariance)
    assert loc.belief is before


# Start over


def test_starting_over_searches_the_whole_map_and_finds_the_robot(world):
    poses = world.path([0.25, 0.0, 0.12], 8)
    loc = world.localizer(20_000, initial=(4.0, 2.0, -2.0))
    loc.process(world.scan(-1.0, (4.0, 2.0, -2.0), odometry=np.zeros(3)))
    loc.start_globally()
    assert np.ptp(loc.belief.particles.states[0]) > 4.5
    *_, last = loc.run(world.scans(poses))
    assert last.pose == pytest.approx(poses[-1], abs=0.1)


# Another map


def test_on_another_map_the_belief_is_kept(world):
    poses = world.path([0.25, 0.0, 0.05], 6)
    moved = world.grid.cells.copy()
    moved[46:54, 76:88] = FREE
    moved[30:36, 90:100] = OCCUPIED
    other = OccupancyGrid(moved, 0.05, world.grid.origin, name="rearranged")
    loc = world.localizer()
    events = world.scans(poses)
    for event in events[:3]:
        loc.process(event)
    before = loc.belief.particles
    loc.swap_map(other)
    assert loc.grid is other
    assert loc.filter.sensor.grid is other
    assert loc.belief.particles is before
    *_, last = loc.run(events[3:])
    assert last.pose == pytest.approx(poses[-1], abs=0.15)
    with pytest.raises(ConfigError, match="inside a wall rearranged"):
        loc.set_pose([4.25, 1.15, 0.0], SURE)


# Several lasers


def two_lasers(world, poses):
    for t, pose in enumerate(poses):
        odometry = between(poses[0], pose)
        yield world.scan(float(t), pose, odometry, "front", FRONT)
        yield world.scan(t + 0.01, pose, odometry, "rear", REAR)


def test_each_laser_is_used_after_the_distance_and_both_are(world):
    poses = world.path([0.12, 0.0, 0.0], 7)
    found = list(world.localizer().run(two_lasers(world, poses)))
    for source in ("front", "rear"):
        used = [e.updated for e in found if e.measurement.source == source]
        assert used == [True, False] * 3 + [True]
    assert set(found[-1].update.info.sizes) == {300}


def test_two_lasers_know_more_than_one(world):
    """Of scans that look ahead only, and of those and others that look back: with both the belief
    is narrower in each of five places.
    """
    poses = world.path([0.25, 0.0, 0.1], 5)
    both = list(world.localizer(20_000).run(two_lasers(world, poses)))
    ahead = [e for e in two_lasers(world, poses) if e.source == "front"]
    one = list(world.localizer(20_000).run(ahead))
    wider = [np.linalg.det(a.covariance) for a in one]
    narrower = [np.linalg.det(b.covariance) for b in both if b.measurement.source == "rear"]
    assert (np.array(narrower) < wider).all()
    assert both[-1].pose == pytest.approx(poses[-1], abs=0.05)


def test_a_laser_that_sees_badly_does_not_set_the_standard_of_the_other(world):
    loc = world.localizer()
    list(loc.run(two_lasers(world, world.path([0.25, 0.0, 0.0], 4))))
    assert set(loc.belief.evidence) == {"front", "rear"}
    front, rear = loc.belief.evidence["front"], loc.belief.evidence["rear"]
    broken = [
        world.scan(10.0 + t, (4.0, 2.5, 1.0), np.array([0.75, 0.0, 0.0]), "rear", REAR)
        for t in range(3)
    ]
    loc.force_update()
    list(loc.run(broken))
    assert loc.belief.evidence["front"] == front
    assert loc.belief.evidence["rear"].fast < rear.fast


def test_scans_that_wait_are_put_in_order(world):
    loc = world.localizer()
    for t, source in ((1.0, "front"), (0.9, "rear"), (1.1, "front")):
        loc.process(world.scan(t, world.start, source=source))
    loc.process(Odometry(0.5, np.zeros(3)))
    done = loc.process(Odometry(1.2, np.zeros(3))) + loc.process(Odometry(2.2, np.zeros(3)))
    assert [e.t for e in done] == [0.9, 1.0, 1.1]
    loc.process(world.scan(1.05, world.start, source="rear"))
    assert loc.ignored == {"late scan": 1}


# Stamps that cannot be


def test_a_scan_from_the_future_makes_nothing_late(world):
    poses = world.path([0.25, 0.0, 0.0], 4)
    events = world.scans(poses)
    events.insert(2, world.scan(1e9, poses[2], np.zeros(3)))
    loc = world.localizer()
    assert [e.t for e in loc.run(events)] == [0.0, 1.0, 2.0, 3.0]
    assert loc.ignored == {"scan stamp from the future": 1}


def test_after_a_pause_the_log_goes_on(world):
    poses = world.path([0.25, 0.0, 0.0], 4)
    stamps = [0, 1, 300, 301]
    late = [world.scan(t, p, between(poses[0], p)) for t, p in zip(stamps, poses, strict=True)]
    loc = world.localizer()
    assert [e.t for e in loc.run(late)] == stamps
    assert not loc.ignored


def test_a_wrong_first_stamp_or_a_clock_set_back_costs_three_scans(world):
    poses = world.path([0.25, 0.0, 0.0], 7)
    events = world.scans(poses)
    events[0] = world.scan(3600.0, poses[0], events[0].odometry)
    loc = world.localizer()
    assert [e.t for e in loc.run(events)] == [3600.0, 3.0, 4.0, 5.0, 6.0]
    assert loc.ignored == {"late scan": 2, "clock of scans set back": 1}


def test_a_slow_laser_is_waited_for(world):
    """The rear laser's scans come 0.2 s after their stamps, those of the front one at once."""
    poses = world.path([0.25, 0.0, 0.0], 12)
    arrivals = []
    for k, pose in enumerate(poses):
        t, odometry = 0.1 * k, between(poses[0], pose)
        arrivals.append((t, world.scan(t, pose, odometry, "front", FRONT)))
        arrivals.append((t + 0.2, world.scan(t - 0.02, pose, odometry, "rear", REAR)))
    arrivals.sort(key=lambda a: a[0])
    loc = world.localizer()
    found = list(loc.run(scan for _, scan in arrivals))
    assert [e.t for e in found] == sorted(e.t for e in found)
    rear = [e for e in found if e.measurement.source == "rear"]
    assert len(rear) >= 10  # what came before the first of them was not waited for
    assert loc.ignored["late scan"] == 12 - len(rear)


def test_a_laser_that_falls_silent_is_not_waited_for(world):
    poses = world.path([0.1, 0.0, 0.0], 30)
    loc = world.localizer()
    loc.process(world.scan(0.0, poses[0], np.zeros(3), "rear", REAR))
    waited = []
    for k, pose in enumerate(poses[1:], 1):
        t = 0.1 * k
        done = loc.process(world.scan(t, pose, between(poses[0], pose), "front", FRONT))
        waited += [t - e.t for e in done if e.measurement.source == "front"]
    assert max(waited) <= 1.1
    assert waited[-1] == 0.0


def test_scans_far_from_any_odometry_are_left_out(world):
    loc = world.localizer()
    for t in (0.0, 5.0, 9.0, 13.5, 20.5):
        loc.process(world.scan(t, world.start))
    for t in (4.0, 4.5, 5.0, 5.5, 13.0, 13.4, 13.8, 19.0):
        loc.process(Odometry(t, np.zeros(3)))
    done = loc.finish()
    assert loc.ignored == {"scan without odometry": 3}  # at 0, in the gap at 9, and at 20.5
    assert done == []


def test_scans_without_odometry_do_not_pile_up(world):
    loc = world.localizer()
    scan = world.scan(0.0, world.start)
    for t in range(1010):
        loc.process(type(scan)(t / 10, scan.ranges, scan.angles, scan.range_max))
    assert loc.ignored == {"scan without odometry": 10}
    done = loc.process(Odometry(101.0, np.zeros(3)))
    assert [e.t for e in done] == [pytest.approx(100.0 + k / 10) for k in range(10)]
