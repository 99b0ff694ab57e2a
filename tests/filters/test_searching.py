"""When a filter searches, and what it does meanwhile: places are kept until scans decide."""

from dataclasses import replace

import numpy as np
import pytest

from mcloc.draws import Draws
from mcloc.evaluation.convergence import recoveries
from mcloc.evaluation.errors import pose_errors
from mcloc.evaluation.kidnapping import find_kidnappings
from mcloc.filters.catalog import Composition
from mcloc.filters.particle_filter import ParticleBelief
from mcloc.filters.recovery import Evidence
from mcloc.localizer import Localizer
from mcloc.localizer.given_pose import given_pose
from mcloc.particles import Particles
from mcloc.report.history import History
from mcloc.simulation import office_drive
from mcloc.simulation.teleports import teleported

USUAL = Evidence(0.9, 0.9, 600.0)
LOST = Evidence(0.3, 0.9, 600.0)


@pytest.fixture(scope="module")
def drive():
    return office_drive(seed=2, length=25.0)


@pytest.fixture(scope="module")
def scans(drive):
    return [event for event in drive.events if hasattr(event, "ranges")]


def tracked(drive, name="mixture", **composition):
    """A filter, and what it believes of a robot whose place is known to 0.1 m."""
    robot = Composition(name, **composition).build(drive.grid)
    start = drive.truth.poses[0]
    noise = np.random.default_rng(0).standard_normal((3, 2000))
    states = start[:, None] + np.array([[0.1], [0.1], [0.05]]) * noise
    source = robot.sensor.source(next(e for e in drive.events if hasattr(e, "ranges")))
    return robot, ParticleBelief(Particles.equal(states), {source: USUAL}), source


def test_a_robot_that_is_localized_is_not_searched_for(drive, scans):
    robot, bel, _ = tracked(drive)
    after, info = robot.step(bel, np.zeros(3), scans[0], Draws(1, 1))
    assert (info.alpha, after.searching) == (0.0, False)


def test_one_doubt_is_settled_by_one_scan_that_fits(drive, scans):
    robot, bel, source = tracked(drive)
    doubting = replace(bel, evidence={source: LOST})
    after, info = robot.step(doubting, np.zeros(3), scans[0], Draws(1, 1))
    assert info.alpha > 0.0
    assert info.n == 5000
    assert not after.searching
    best = after.particles.states @ after.particles.weights
    assert np.hypot(*(best - drive.truth.poses[0])[:2]) < 0.1


def test_a_robot_that_is_somewhere_else_is_searched_for_until_all_is_in_one_place(drive):
    localizer = Localizer(drive.grid, "mixture", seed=1, initial=drive.truth.poses[0] + [1.5, 0, 2])
    source = localizer.filter.sensor.source(next(e for e in drive.events if hasattr(e, "ranges")))
    localizer.belief = replace(localizer.belief, evidence={source: LOST})
    sure, errors, several = [], [], 0
    for estimate in localizer.run(drive.events):
        if not estimate.updated:
            continue
        sure.append(not localizer.belief.searching)
        truth = drive.truth.at(np.array([estimate.t]))[0]
        errors.append(np.hypot(*(estimate.pose - truth)[:2]))
        if not sure[-1]:
            assert estimate.update.info.n == 5000
        if len(estimate.update.hypotheses) > 1:  # one of which must be wrong
            assert localizer.belief.evidence[source].slow == LOST.slow
            several += 1
    assert several > 0
    first = sure.index(True)
    assert 0 < first < len(sure) / 2
    assert all(sure[first:])
    assert max(errors[first:]) < 0.3


def test_a_uniform_start_has_as_many_particles_as_a_search(drive):
    robot, _, _ = tracked(drive)
    bel = robot.start(robot.environment, Draws(1))
    assert (len(bel.particles), bel.uniform, bel.searching) == (5000, True, True)
    known = robot.start(bel_at(drive), Draws(1))
    assert (known.uniform, known.searching) == (False, False)


def bel_at(drive):
    return given_pose(drive.grid, "start", drive.truth.poses[0], np.diag([0.01, 0.01, 0.01]))


def test_how_likely_it_was_carried_off_is_held_down(drive, scans):
    """The mass that leaves the place believed in, after one scan, is about in proportion."""
    masses = []
    for carried_off in (1e-2, 1e-4):
        robot, bel, source = tracked(drive, settings={"filter": {"carried_off": carried_off}})
        bel = replace(bel, evidence={source: LOST})
        after, _ = robot.step(bel, np.zeros(3), replace(scans[0], novelty=0.2), Draws(1, 1))
        apart = np.hypot(*(after.particles.states - drive.truth.poses[0][:, None])[:2])
        masses.append(after.particles.weights[apart > 1.0].sum())
    assert masses[0] == pytest.approx(100.0 * masses[1], rel=0.02)


def test_a_constant_share_of_random_particles_is_no_search(drive, scans):
    robot, bel, source = tracked(drive, "mcl", recovery="random")
    after, info = robot.step(bel, np.zeros(3), scans[0], Draws(1, 1))
    assert info.alpha > 0.0
    assert not after.searching
    assert after.evidence[source].readings > 600.0


# Carried off


def recovered_after(drive, name, seed):
    """Metres from the first kidnapping until the estimate stays within 0.5 m and 10°, else inf."""
    moved = teleported(drive.events, drive.truth, seed, per_metre=0.04, length=50.0)
    few = Composition(name, settings={"size": {"maximum": 5000}})
    localizer = Localizer(drive.grid, few, seed=seed, initial=moved.truth.poses[0])
    history = History()
    for estimate in localizer.run(moved):
        history.add(estimate)
    errors = pose_errors(history.trajectory, moved.truth)
    listed = find_kidnappings(errors.t, errors.reference, history.wheels, moved.kidnappings)
    found = [r for r in recoveries(errors, listed)[1:] if r.path_m > 10.0]
    return [np.inf if r.after_m is None else r.after_m for r in found]


@pytest.fixture(scope="module")
def distances(drive):
    names = ("mixture", "mcl", "sensor-resetting")
    return {name: [d for s in range(4) for d in recovered_after(drive, name, s)] for name in names}


@pytest.mark.parametrize("name", ["mixture", "sensor-resetting"])
def test_a_robot_that_is_carried_off_is_found_within_metres(distances, name):
    """At least 6 stretches of 10 m or more; all but one found, half of them within 3 m."""
    found = distances[name]
    assert len(found) >= 6
    assert np.isfinite(found).sum() >= len(found) - 1
    assert np.median(found) < 3.0


def test_random_particles_take_longer(distances):
    assert np.median(distances["mixture"]) < np.median(distances["mcl"])


def crowded(scan, share, rng):
    """A scan of which a block of beams, anywhere, ends at people beside the robot."""
    n = len(scan.ranges)
    block = (rng.integers(n) + np.arange(round(share * n))) % n
    ranges = scan.ranges.copy()
    ranges[block] = rng.uniform(0.6, 1.0, len(block))
    return replace(scan, ranges=ranges)


def test_scans_that_stay_worse_become_usual():
    """A crowd that hides two fifths of the laser from 8 m on does not make the filter search for
    ever.
    """
    drive = office_drive(seed=2, length=40.0)
    rng = np.random.default_rng(5)
    localizer = Localizer(drive.grid, "mixture", seed=1, initial=drive.truth.poses[0])
    begins = 0.2 * drive.events[-1].t
    searching, errors = [], []
    for event in drive.events:
        later = hasattr(event, "ranges") and event.t > begins
        for estimate in localizer.process(crowded(event, 0.4, rng) if later else event):
            if estimate.updated:
                searching.append(localizer.belief.searching)
                truth = drive.truth.at(np.array([estimate.t]))[0]
                errors.append(np.hypot(*(estimate.pose - truth)[:2]))
    assert any(searching)
    assert np.mean(searching[-len(searching) // 3 :]) < 0.5
    assert max(errors) < 0.3
