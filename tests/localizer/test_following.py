"""Steps by the wheels alone, where nothing is measured for long."""

import numpy as np
import pytest

from mcloc.events import Odometry, Sightings
from mcloc.geometry import compose
from mcloc.localizer import Localizer, Modelled, UpdatePolicy
from mcloc.maps.landmarks import Landmarks, open_floor

PLACES = [[2.0, 0.0], [0.0, 3.0], [-2.5, -1.0]]
SIDE, STEP = 2.0, 0.1  # m
START = np.array([0.0, -0.5, 0.2])


def around_a_square(coast):
    """A robot that drives around a square, back to where it was, and sees nothing on the way."""
    localizer = Localizer(
        open_floor(np.array(PLACES), 8.0, "floor"),
        "mcl",
        aids=[Landmarks.numbered(PLACES)],
        seed=1,
        initial=START,
        initial_sigma=(0.02, 0.02, 0.01),
        policy=UpdatePolicy(coast=coast),
    )
    pose, t, found = np.zeros(3), 0.0, []
    localizer.process(Sightings(0.0, [0], [np.hypot(2.0, 0.5)], [np.nan], odometry=pose))
    for _ in range(4):
        for _ in range(round(SIDE / STEP)):
            pose, t = compose(pose, [STEP, 0.0, 0.0]), t + 0.5
            localizer.process(Odometry(t, pose))
            found += localizer.follow(t)
        pose = compose(pose, [0.0, 0.0, np.pi / 2.0])
    return localizer, pose, found


def test_a_loop_makes_less_sure_than_standing_still():
    """To first order in the model's deviations: each side errs by its own."""
    spreads = {}
    for coast in (0.5, 100.0):
        localizer, pose, found = around_a_square(coast)
        particles = localizer.predicted(pose)
        off = particles.states[:2] - compose(START, pose)[:2, None]
        spreads[coast] = float(np.sqrt((off**2).sum(axis=0) @ particles.weights))
        assert bool(found) == (coast < SIDE)
    assert spreads[0.5] > 0.3  # 16 steps with turns of 0.1 rad over lengths of up to 2.8 m
    assert spreads[100.0] < 0.15  # by the net move it stood still


def test_estimates_come_each_half_metre_and_tell_of_no_measurement():
    _, _, found = around_a_square(0.5)
    apart = np.diff([e.t for e in found])
    assert np.median(apart) == 2.5  # s: 0.5 m at 0.2 m/s; sooner after the turn of a corner
    assert all(not e.measurement.useful and e.updated for e in found)
    assert len(found) == pytest.approx(4 * SIDE / 0.5, abs=4)


def test_who_has_no_place_follows_nothing():
    localizer = Localizer(
        open_floor(np.array(PLACES), 8.0, "floor"), aids=[Landmarks.numbered(PLACES)], seed=1
    )
    for t in range(20):
        localizer.process(Odometry(float(t), np.array([float(t), 0.0, 0.0])))
        assert localizer.follow(float(t)) == []


def test_a_busy_filter_follows_nothing():
    localizer = Localizer(
        open_floor(np.array(PLACES), 8.0, "floor"),
        "mcl",
        aids=[Landmarks.numbered(PLACES)],
        seed=1,
        initial=START,
        pace=Modelled(1.0),
    )
    localizer.process(Sightings(0.0, [0], [2.0], [np.nan], odometry=np.zeros(3)))
    for t in range(1, 10):
        localizer.process(Odometry(float(t), np.array([float(t), 0.0, 0.0])))
        assert localizer.follow(float(t)) == []
    assert not localizer.ignored
