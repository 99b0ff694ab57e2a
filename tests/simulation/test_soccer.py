"""The soccer field: what the robot does on it and what it sees, and that a particle filter of the
max distance and landmark models has the posterior of Bayes' rule on a grid.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import fftconvolve
from scipy.stats import binomtest, kstest, norm

from mcloc.draws import Draws
from mcloc.environment import Box
from mcloc.errors import ConfigError
from mcloc.events import Sightings
from mcloc.filters.particle_filter import Part, ParticleFilter
from mcloc.filters.recovery import NoRandomParticles
from mcloc.geometry import wrap
from mcloc.maps.landmarks import Landmarks
from mcloc.motion.max_distance import MaxDistanceMotion
from mcloc.proposals.forward import Forward
from mcloc.resampling import Systematic
from mcloc.sample_size import Fixed
from mcloc.sensors.landmarks import LandmarkModel
from mcloc.simulation.soccer import (
    AIBO,
    FOUR_LEGGED,
    MARGIN,
    SPEED,
    TURN,
    HeadCamera,
    SoccerField,
    drive,
    seen,
)

POSE = np.array([-0.8, 0.5, 0.3])
EXACT = HeadCamera(sigma_range=0.0, sigma_relative=0.0, sigma_bearing=0.0, p_outlier=0.0)


def test_the_field_is_the_same_for_both_teams():
    """After half a turn each landmark is where its counterpart was."""
    place = dict(zip(FOUR_LEGGED.names, FOUR_LEGGED.places, strict=True))
    swap = {"front": "rear", "rear": "front", "left": "right", "right": "left"}
    goals = {"opponents' goal": "own goal", "own goal": "opponents' goal"}
    for name, at in place.items():
        other = goals.get(name) or " ".join(swap.get(word, word) for word in name.split())
        assert (place[other] == -at).all()
    assert place["opponents' goal"].tolist() == [FOUR_LEGGED.half_length, 0.0]
    beacons = np.array([at for name, at in place.items() if "beacon" in name])
    assert (np.abs(beacons[:, 1]) > FOUR_LEGGED.half_width).all()


@pytest.mark.parametrize("interval", [0.1, 2.0])
def test_the_robot_stays_on_the_field_and_within_its_means(interval):
    poses = drive(3, 2000, interval)
    assert poses.shape == (2001, 3)
    assert (np.abs(poses[:, :2]) <= (2.7 - MARGIN, 1.8 - MARGIN)).all()
    assert (np.abs(poses[:, 2]) <= np.pi).all()
    motion = MaxDistanceMotion(speed=SPEED, turn_rate=TURN)
    assert np.isfinite(motion.log_density(poses[1:].T, interval, poses[:-1].T)).all()


def test_the_robot_gets_about_and_turns_where_it_goes():
    poses = drive(4, 4000, 0.2)
    visits = np.histogram2d(*poses[:, :2].T, bins=(4, 3), range=((-2.7, 2.7), (-1.8, 1.8)))[0]
    assert (visits > 0).all()
    step = np.diff(poses[:, :2], axis=0)
    way = np.arctan2(step[:, 1], step[:, 0])
    most = SPEED * 0.2 * np.maximum(0.2, np.cos(way - poses[:-1, 2]))
    assert (np.hypot(*step.T) > 0.0).all()
    assert (np.hypot(*step.T) <= most + 1e-9).all()  # sideways it is slower
    askew = np.abs(wrap(way - poses[1:, 2]))
    assert np.median(askew) < 1e-9
    assert askew.max() > 1.0  # it has to turn for a new place
    assert np.histogram(poses[:, 2], 8, (-np.pi, np.pi))[0].min() > 0


def test_a_drive_is_its_seed():
    assert np.array_equal(drive(1, 50, 0.2), drive(1, 50, 0.2))
    assert np.array_equal(drive(1, 50, 0.2)[:21], drive(1, 20, 0.2))
    assert not np.array_equal(drive(1, 50, 0.2), drive(2, 50, 0.2))
    assert drive(1, 0, 0.2).shape == (1, 3)


@pytest.mark.parametrize(("pan", "fov"), [(90.0, 57.0), (0.0, 57.0), (90.0, 180.0)])
def test_what_is_in_view_is_seen_as_it_is(pan, fov):
    camera = replace(EXACT, pan=np.radians(pan), fov=np.radians(fov))
    rng = np.random.default_rng(1)
    for pose in drive(5, 100, 1.0):
        z = seen(pose, rng, camera)
        to = FOUR_LEGGED.places @ [1.0, 1.0j] - pose[:2] @ [1.0, 1.0j]
        bearing = np.angle(to * np.exp(-1j * pose[2]))
        shown = np.abs(np.degrees(bearing)) <= pan + fov / 2.0
        assert z.landmark.tolist() == np.flatnonzero(shown).tolist()
        assert z.range == pytest.approx(np.abs(to)[shown])
        assert z.bearing == pytest.approx(bearing[shown])
    assert np.degrees(AIBO.view) == pytest.approx(118.5)


def many(camera, n, pose=POSE):
    """(n, k): ranges and bearings of n looks from one pose, and what is true."""
    rng = np.random.default_rng(2)
    looks = [seen(pose, rng, camera) for _ in range(n)]
    true = seen(pose, rng, EXACT)
    ranges, bearings = (
        np.array([getattr(z, name) for z in looks]) for name in ("range", "bearing")
    )
    return ranges, bearings, true


def test_errors_are_normal_and_grow_with_the_distance():
    ranges, bearings, true = many(replace(AIBO, p_outlier=0.0), 2000)
    assert len(true.range) >= 3
    for k, d in enumerate(true.range):
        sigma = np.sqrt(0.05**2 + (0.1 * d) ** 2)
        assert kstest((ranges[:, k] - d) / sigma, "norm").pvalue > 1e-4
        off = wrap(bearings[:, k] - true.bearing[k])
        assert kstest(off / 0.05, "norm").pvalue > 1e-4
    errors = np.column_stack([ranges - true.range, wrap(bearings - true.bearing)])
    unlike = np.corrcoef(errors.T) - np.eye(errors.shape[1])
    assert np.abs(unlike).max() < 4.5 / np.sqrt(2000)


def test_as_many_are_anything_as_it_says():
    """Of ranges and of bearings, apart from each other, and spread evenly."""
    camera = replace(EXACT, p_outlier=0.2)
    ranges, bearings, true = many(camera, 2000)
    wild = np.abs(ranges - true.range) > 1e-9, np.abs(bearings - true.bearing) > 1e-9
    both = wild[0] & wild[1]
    n = ranges.size
    for which in wild:
        assert binomtest(int(which.sum()), n, 0.2).pvalue > 1e-4
    assert binomtest(int(both.sum()), n, 0.04).pvalue > 1e-4
    assert kstest(ranges[wild[0]] / 8.0, "uniform").pvalue > 1e-4
    assert kstest(bearings[wild[1]] / (2.0 * np.pi) + 0.5, "uniform").pvalue > 1e-4
    assert abs(np.corrcoef(ranges[both], bearings[both])[0, 1]) < 4.5 / np.sqrt(both.sum())


def test_a_range_that_cannot_be_reported_is_none():
    camera = replace(AIBO, p_outlier=0.0, range_max=2.0)
    ranges, _, true = many(camera, 1000)
    sigma = np.sqrt(0.05**2 + (0.1 * true.range) ** 2)
    for k, d in enumerate(true.range):
        missing = int(np.isnan(ranges[:, k]).sum())
        assert binomtest(missing, 1000, norm.sf(2.0, d, sigma[k])).pvalue > 1e-4
    assert not (ranges > 2.0).any()
    near = many(camera, 1000, np.array([2.68, 0.0, 0.0]))[0]
    assert np.isnan(near[:, 0]).any()
    assert not (near <= 0.0).any()


def test_one_landmark_more_in_view_leaves_the_others_alone():
    narrow = replace(AIBO, pan=0.0)
    few, all_of_them = (seen(POSE, np.random.default_rng(3), c) for c in (narrow, AIBO))
    common = np.isin(all_of_them.landmark, few.landmark)
    assert 0 < common.sum() < len(common)
    assert np.array_equal(all_of_them.range[common], few.range)
    assert np.array_equal(all_of_them.bearing[common], few.bearing)


CELL, INTERVAL, STEPS = 0.05, 1.0, 6
SENSOR = LandmarkModel(Landmarks.numbered(FOUR_LEGGED.places), sigma_range=0.3, sigma_relative=0.3)


def moments(x, w):
    """Mean and variance of x and y."""
    mean = x[:2] @ w
    return np.concatenate([mean, ((x[:2] - mean[:, None]) ** 2) @ w])


def on_a_grid(sightings):
    """(4,): moments of the place by Bayes' rule, cell by cell, of ranges alone."""
    axes = [np.arange(-h + CELL / 2, h, CELL) for h in (2.7, 1.8)]
    x, y = np.meshgrid(*axes, indexing="ij")
    fine = 20  # points along a cell's side, to find which share of it a disc covers
    reach = int(np.ceil(SPEED * INTERVAL / CELL)) + 1
    at = CELL * ((np.arange((2 * reach + 1) * fine) + 0.5) / fine - 0.5 - reach)
    inside = np.hypot(*np.meshgrid(at, at)) <= SPEED * INTERVAL
    disc = inside.reshape(2 * reach + 1, fine, 2 * reach + 1, fine).mean(axis=(1, 3))
    bel = np.ones_like(x)
    for z in sightings:
        bel = np.maximum(fftconvolve(bel, disc / disc.sum(), mode="same"), 0.0)
        for landmark, r in zip(z.landmark, z.range, strict=True):
            d = np.hypot(*(FOUR_LEGGED.places[landmark][:, None, None] - (x, y)))
            sigma = np.sqrt(0.3**2 + (0.3 * d) ** 2)
            bel *= 0.99 * norm.pdf(r, d, sigma) + 0.01 / 8.0
        bel /= bel.sum()
    return moments(np.stack([x.ravel(), y.ravel()]), bel.ravel())


def by_particles(sightings, n, seed):
    """(4,): the same by a particle filter over poses in a box of places and headings."""
    where = Box((-2.7, -1.8, -np.pi), (2.7, 1.8, np.pi))
    motion = MaxDistanceMotion(speed=SPEED, turn_rate=TURN)
    part = Part(1.0, Forward(Systematic()), Fixed(n))
    robot = ParticleFilter(motion, SENSOR, where, (part,), NoRandomParticles(doubt_below=0.0))
    bel = robot.start(where, Draws(seed))
    for step, z in enumerate(sightings, 1):
        bel, _ = robot.step(bel, INTERVAL, z, Draws(seed, step))
    return moments(bel.particles.states, bel.particles.weights)


def test_a_particle_filter_has_the_posterior_of_a_grid():
    """Within 4.5 standard errors of the mean of 16 filters, and half a percent of the field's width
    for what cells and a finite number of samples do.
    """
    camera = HeadCamera(sigma_range=0.3, sigma_relative=0.3, pan=0.5)
    rng = np.random.default_rng(8)
    looks = [seen(pose, rng, camera) for pose in drive(6, STEPS, INTERVAL)[1:]]
    ranges = [Sightings(0.0, z.landmark, z.range, np.full(len(z.range), np.nan)) for z in looks]
    assert all(len(z.range) and np.isfinite(z.range).all() for z in ranges)
    wanted = on_a_grid(ranges)
    found = np.array([by_particles(ranges, 4000, seed) for seed in range(16)])
    error = found.std(axis=0, ddof=1) / np.sqrt(len(found))
    assert (error < 0.02).all()  # or the comparison says nothing
    assert (np.abs(found.mean(axis=0) - wanted) < 4.5 * error + 0.005).all()


def test_the_belief_is_as_sure_as_it_may_be():
    """Truths that are drawn from the prior and moved as the motion model says: the share of the
    belief that lies below such a truth is uniform [Talts et al.: simulation-based calibration].
    """
    rng = np.random.default_rng(9)
    errs = {"sigma_range": 0.3, "sigma_bearing": 0.2, "p_outlier": 0.1}
    camera, sensor = (
        HeadCamera(pan=np.pi, **errs),
        LandmarkModel(Landmarks.numbered(FOUR_LEGGED.places), **errs),
    )
    where = Box((-2.7, -1.8, -np.pi), (2.7, 1.8, np.pi))
    start = Box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    part, recovery = Part(1.0, Forward(Systematic()), Fixed(1000)), NoRandomParticles(doubt_below=0)
    robot = ParticleFilter(MaxDistanceMotion(), sensor, where, (part,), recovery)
    below = []
    for seed in range(150):
        pose = rng.uniform(-0.5, 0.5, 3)
        bel = robot.start(start, Draws(seed))
        for step in range(1, 4):
            move = np.array([np.inf, 0.0])
            while np.hypot(*move) > 1.0:
                move = rng.uniform(-1.0, 1.0, 2)
            pose = pose + np.array([*(0.15 * move), rng.uniform(-0.75, 0.75)])
            bel, _ = robot.step(bel, 0.5, seen(pose, rng, camera), Draws(seed, step))
        x = bel.particles.states.copy()
        x[2] = wrap(x[2] - pose[2])
        pose[2] = 0.0
        below.append((x < pose[:, None]) @ bel.particles.weights)
    for shares in np.transpose(below):
        assert kstest(shares, "uniform").pvalue > 1e-4


WRONG_DRIVES = [(-1, 5, 0.1), (1, -5, 0.1), (1, 5, 0.0), (1, 5, np.nan), (1, 5, np.inf)]


@pytest.mark.parametrize("wrong", WRONG_DRIVES)
def test_a_drive_that_cannot_be_is_refused(wrong):
    with pytest.raises(ConfigError, match="must be"):
        drive(*wrong)


@pytest.mark.parametrize("pose", [[0.0, 0.0], [0.0, 0.0, np.nan], np.zeros((2, 3))])
def test_a_pose_that_cannot_be_is_refused(pose):
    with pytest.raises(ConfigError, match="pose"):
        seen(pose, np.random.default_rng(0))


@pytest.mark.parametrize(
    "wrong", [{"half_width": 0.2}, {"half_length": np.inf}, {"names": ()}, {"places": np.ones(2)}]
)
def test_a_field_that_cannot_be_is_refused(wrong):
    with pytest.raises(ConfigError, match=r"field|landmarks"):
        replace(FOUR_LEGGED, **wrong)


@pytest.mark.parametrize("wrong", [{"fov": 0.0}, {"pan": -1.0}, {"p_outlier": 1.5}])
def test_a_camera_that_cannot_be_is_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        HeadCamera(**wrong)


def test_fields_of_other_sizes_work():
    small = SoccerField(1.0, 0.5, ("post",), np.array([[1.0, 0.0]]))
    poses = drive(0, 500, 0.5, small)
    assert (np.abs(poses[:, :2]) <= (0.8, 0.3)).all()
    assert (np.abs(poses[:, :2]).max(axis=0) > (0.6, 0.2)).all()
    assert seen([0.0, 0.0, 0.0], np.random.default_rng(0), EXACT, small).range.tolist() == [1.0]
