"""Ceilings and drives under them: images against the mosaic, drifts, blackouts, wheels that err."""

import numpy as np
import pytest

from mcloc.errors import ConfigError
from mcloc.events import Image, Odometry
from mcloc.geometry import between, compose, wrap
from mcloc.simulation import (
    CeilingCamera,
    CeilingPlan,
    CeilingTour,
    Wheels,
    ceiling_drive,
    ceiling_mosaic,
    museum_world,
)

PLAIN = CeilingCamera(noise=0.0, gain=0.0, offset=0.0, covered=0.0, dust=0.0)
EXACT = Wheels(scale=0.0, drift=0.0, sigma_distance=0.0, sigma_turn=0.0, sigma_drift=0.0)


@pytest.fixture(scope="module")
def world():
    return museum_world(0)


def test_a_ceiling_covers_the_map_and_is_that_of_its_seed(world):
    one, again, other = (ceiling_mosaic(world, seed) for seed in (1, 1, 2))
    assert np.array_equal(one.image, again.image)
    assert not np.array_equal(one.image, other.image)
    assert one.origin == pytest.approx(world.origin)
    size = np.array(one.image.shape) * one.resolution
    assert (size >= np.array(world.cells.shape) * world.resolution - 1e-9).all()
    assert np.isfinite(one.image).all()
    assert 0.0 <= one.image.min() < 0.3
    assert 0.9 < one.image.max() <= 1.0


def test_lamps_repeat_and_some_are_out(world):
    """Lamps alone: the ceiling is as bright a bay further, but where one of two is out."""
    plan = CeilingPlan(shading=0.0, dirt=0.0, skylights=0.0, out=0.2, gap=2.0, row=2.5)
    lit = ceiling_mosaic(world, 3, plan).image > 0.7
    share = lit.mean() / (0.8 * 1.2 * 0.3 / (2.0 * 2.5))
    assert share == pytest.approx(1.0, abs=0.15)
    further = lit[50:] & lit[:-50]  # 2.5 m
    assert further.sum() / lit[50:].sum() == pytest.approx(0.8, abs=0.1)


def test_images_show_the_mosaic_as_the_robot_is_turned(world):
    drive = ceiling_drive(world, 0, CeilingTour(duration=30.0, camera=PLAIN))
    images = [event for event in drive if isinstance(event, Image)]
    assert len(images) == round(30.0 * 5.185) == len(drive.truth.t)
    smooth = drive.mosaic
    for k in (0, 50, 120):
        image, pose = images[k], drive.truth.poses[k]
        for row, column in ((0, 7), (7, 0), (7, 7), (14, 14)):
            place = compose(pose, [0.1 * (7 - row), 0.1 * (7 - column), 0.0])
            off = 0.05 * (np.arange(2) - 0.5)
            corners = np.stack(np.meshgrid(place[0] + off, place[1] + off)).reshape(2, -1)
            seen = smooth.at(corners).mean()
            assert image.pixels[row, column] == pytest.approx(seen, abs=0.06)


def test_a_drive_is_that_of_its_seed_each_time(world):
    tour = CeilingTour(duration=20.0)
    drives = [ceiling_drive(world, seed, tour) for seed in (4, 4, 5)]
    told = [
        [e.pose if isinstance(e, Odometry) else e.pixels for e in drive]
        for drive in (*drives, drives[0])
    ]
    assert len(told[0]) == len(told[1])
    assert all(np.array_equal(a, b) for a, b in zip(told[0], told[1], strict=True))
    assert all(np.array_equal(a, b) for a, b in zip(told[0], told[3], strict=True))
    assert not all(np.array_equal(a, b) for a, b in zip(told[0], told[2], strict=False))


def test_events_come_in_order_and_speeds_are_those_of_the_tour(world):
    tour = CeilingTour(duration=200.0, slowest=0.4, fastest=1.63)
    drive = ceiling_drive(world, 1, tour)
    stamps = [event.t for event in drive]
    assert stamps == sorted(stamps)
    way = np.hypot(*np.diff(drive.truth.poses[:, :2], axis=0).T)
    turn = np.abs(wrap(np.diff(drive.truth.poses[:, 2])))
    assert way.max() * tour.images <= 1.63 + 1e-6
    assert way.max() * tour.images > 1.0
    assert turn.max() * tour.images <= 1.2 + 1e-6
    assert drive.distance == pytest.approx(way.sum())


def test_wheels_err_once_at_the_jump_and_at_each_bump(world):
    jump = (3.0, -2.0, 1.0)
    tour = CeilingTour(duration=60.0, jump_at=20.0, jump=jump, wheels=EXACT)
    drive = ceiling_drive(world, 2, tour)
    true = ceiling_drive(world, 2, CeilingTour(duration=60.0, wheels=EXACT))
    moves, told = (between(d.wheels.poses[:-1], d.wheels.poses[1:]) for d in (true, drive))
    off = np.abs(moves - told).max(axis=1)
    assert np.flatnonzero(off > 1e-9).tolist() == [200]
    assert told[200] == pytest.approx(compose(np.array(jump), moves[200]), abs=1e-6)
    bumpy = CeilingTour(duration=60.0, bump=0.1, bump_turn=0.2, wheels=EXACT)
    drive = ceiling_drive(world, 2, bumpy)
    told = between(drive.wheels.poses[:-1], drive.wheels.poses[1:])
    wrong = np.flatnonzero(np.abs(moves - told).max(axis=1) > 1e-9)
    assert drive.wheels.t[wrong].tolist() == list(drive.bumps)
    assert len(drive.bumps) > 0
    assert true.bumps == ()


def test_a_camera_drifts_and_is_covered_as_often_as_it_says(world):
    camera = CeilingCamera(noise=0.0, dust=0.0, covered=0.2, covering=1.0, glow=0.0)
    drive = ceiling_drive(world, 3, CeilingTour(duration=1500.0, camera=camera))
    middles = np.array([e.pixels[7, 7] for e in drive if isinstance(e, Image)])
    dark = np.array([e.pixels.max() < 0.05 for e in drive if isinstance(e, Image)])
    # 300 times 1 s of them: the share's deviation is about 0.2 √(2 / 300).
    assert dark.mean() == pytest.approx(0.2, abs=0.05)
    assert np.ptp(middles[~dark]) > 0.3
    plain = ceiling_drive(world, 3, CeilingTour(duration=1500.0, camera=PLAIN))
    true = np.array([e.pixels[7, 7] for e in plain if isinstance(e, Image)])
    ratio = (middles / np.maximum(true, 1e-3))[~dark & (true > 0.2) & (middles < 0.99)]
    # gain 0.08, offset 0.02 / 0.4; 25 times the memory
    assert 0.03 < ratio.std() < 0.2


@pytest.mark.parametrize("at", [0.0, 20.0, 30.0])
def test_a_jump_after_the_end_is_refused(world, at):
    with pytest.raises(ConfigError, match="within the drive"):
        ceiling_drive(world, 0, CeilingTour(duration=20.0, jump_at=at))
