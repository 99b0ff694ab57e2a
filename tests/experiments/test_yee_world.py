"""The world of E15 to E17: what its description says of it holds."""

import numpy as np
import pytest
from scipy import ndimage

from mcloc.errors import ConfigError
from mcloc.experiments import yee_world as yee
from mcloc.experiments.driving import EVERY_SCAN, errors_of, localized
from mcloc.filters.catalog import Composition
from mcloc.geometry import between
from mcloc.maps.occupancy import FREE
from mcloc.motion.odometry import OdometryMotion
from mcloc.simulation.ranges import ranges

ALL = range(len(yee.PATHS))


def steps_of(poses):
    return np.hypot(*np.diff(poses[:, :2], axis=0).T)


def to_wall():
    """Metres from each cell to what is not free."""
    grid = yee.yee_world()
    return ndimage.distance_transform_edt(grid.free) * grid.resolution


def test_the_floor_has_no_holes_and_is_one_whole():
    grid = yee.yee_world()
    assert ndimage.label(grid.free)[1] == 1  # rooms are joined by doors, 0.9 m or wider
    assert ndimage.label(to_wall() > 0.4)[1] == 1
    around = ndimage.binary_dilation(grid.free, np.ones((3, 3))) & ~grid.free
    assert grid.occupied[around].all()
    assert to_wall().max() < yee.REACH


def test_no_turn_or_mirror_image_of_the_floor_is_like_it():
    """A tenth of the free cells, or more, lies where the other one has none."""
    free = yee.yee_world().cells == FREE
    for other in (free[::-1], free[:, ::-1], free[::-1, ::-1]):
        assert (free & ~other).sum() > 0.1 * free.sum()


@pytest.mark.parametrize("k", ALL)
def test_a_path_keeps_clear_of_walls_and_is_as_long_as_it_says(k):
    poses = yee.path(k)
    row, column = yee.yee_world().cell_of(poses)
    assert to_wall()[row, column].min() > 0.25
    assert 16.0 < steps_of(poses).sum() < 19.0
    assert steps_of(poses).max() < 0.15 + 1e-9
    assert np.abs(between(poses[:-1], poses[1:])[:, 2]).max() < 0.3 + 1e-9
    assert 100 < len(poses) < 150


def test_all_rooms_are_entered():
    places = np.concatenate([yee.path(k)[:, :2] for k in ALL])
    for room in yee.ROOMS:
        inside = (places > (room.left, room.bottom)) & (places < (room.right, room.top))
        assert inside.all(axis=1).sum() >= 7  # a metre


@pytest.mark.parametrize("k", ALL)
def test_a_kidnapped_robot_goes_on_elsewhere_and_its_wheels_do_not_tell(k):
    drive, first, then = yee.kidnapped(k, 0), yee.path(k), yee.path(yee.GOES_ON[k])
    poses, at = drive.truth.poses, len(first) // 2
    assert np.array_equal(poses[:at], first[:at])
    assert np.array_equal(poses[at:], then[: len(then) // 2])
    assert np.hypot(*(poses[at, :2] - poses[at - 1, :2])) > 5.0
    odometry = np.array([scan.odometry for scan in drive.events])
    assert np.array_equal(odometry[at], odometry[at - 1])
    np.testing.assert_allclose(drive.truth.t, [scan.t for scan in drive.events])


def test_each_seed_has_noise_of_its_own_on_the_same_path():
    one, again, other = (yee.driven(1, seed) for seed in (3, 3, 4))
    for a, b, c in zip(one.events, again.events, other.events, strict=True):
        assert np.array_equal(a.ranges, b.ranges)
        assert np.array_equal(a.odometry, b.odometry)
        assert not np.array_equal(a.ranges, c.ranges)
    assert not np.array_equal(one.events[-1].odometry, other.events[-1].odometry)
    assert np.array_equal(one.truth.poses, other.truth.poses)


def test_the_sonars_err_as_the_description_says():
    """Of walls up to 2.4 m away, whose readings are in reach: 5 % of the range, 5 % none, 5 %
    anything, of which about 1 in 20 lies near the wall too.
    """
    ratios, missed = [], []
    fan = np.linspace(-yee.CONE / 2.0, yee.CONE / 2.0, 41)
    for k in ALL:
        drive = yee.driven(k, 1)
        rays = [
            ranges(drive.grid, drive.truth.poses, yee.SONAR.angles + aside, yee.REACH)
            for aside in fan
        ]
        expected, found = np.min(rays, axis=0), np.array([z.ranges for z in drive.events])
        near = expected < 2.4
        missed.append(np.isinf(found)[near])
        ratios.append(found[near & np.isfinite(found)] / expected[near & np.isfinite(found)])
    ratio, none = np.concatenate(ratios), np.concatenate(missed)
    n = len(none)
    sure = 5.0 * np.sqrt(0.05 * 0.95 / n)
    assert none.mean() == pytest.approx(yee.MISSED * (1.0 - yee.UNEXPECTED), abs=sure)
    hits = np.abs(ratio - 1.0) < 4.0 * yee.NOISE
    # Anything within 20 % of the range e, up to 2.4 m: 0.4 e / 3 m of it, about 0.15.
    assert 1.0 - hits.mean() == pytest.approx(0.86 * yee.UNEXPECTED, abs=sure + 0.005)
    assert np.median(np.abs(ratio - 1.0)) / 0.6745 == pytest.approx(yee.NOISE, rel=0.05)
    assert len(yee.SONAR.angles) == 16
    gaps = np.diff(np.append(yee.SONAR.angles, yee.SONAR.angles[0] + 2.0 * np.pi))
    np.testing.assert_allclose(gaps, 2.0 * np.pi / 16.0)


@pytest.mark.parametrize("u", [(0.15, 0.0, 0.0), (0.0, 0.0, 0.3)])
def test_wheels_err_about_as_much_as_the_motion_model_expects(u):
    step = OdometryMotion().decompose(np.array(u))
    poses = np.array([[0.0, 0.0, 0.0], u])
    rng = np.random.default_rng(2)
    ends = np.array([yee.WHEELS.measure(poses, rng)[1] for _ in range(2000)]) - u
    expected = np.hypot(step.sd_rot1, step.sd_rot2)
    assert ends[:, 2].std() == pytest.approx(expected, rel=0.15)
    if u[0]:
        assert ends[:, 0].std() == pytest.approx(step.sd_trans, rel=0.15)
    assert np.abs(ends.mean(axis=0)).max() < 0.005  # nothing that stays


def test_a_robot_that_knows_its_place_is_tracked():
    """With 300 samples; measured with 100 on all paths, 5 seeds each: never lost."""
    drive = yee.driven(0, 0)
    mcl = Composition(
        "mcl",
        sensor="beam-yee",
        size="fixed",
        recovery="none",
        settings={"size": {"particles": 300}, "sensor": yee.SENSOR},
    )
    history = localized(drive, mcl, 0, initial=drive.truth.poses[0], policy=EVERY_SCAN)
    errors = errors_of(drive, history)
    assert len(history.updates) == len(drive.events)
    assert errors.lost_fraction(0.5) == 0.0
    assert errors.position.mean() < 0.1


@pytest.mark.parametrize("k", [-1, 4])
def test_there_are_four_paths(k):
    with pytest.raises(ConfigError, match=r"0 … 3"):
        yee.path(k)
