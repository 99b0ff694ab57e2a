"""Rings of sonars, simulated, and derived from laser scans."""

import numpy as np
import pytest

from mcloc.errors import ConfigError
from mcloc.events import Odometry, Scan
from mcloc.simulation import Laser, Scenario, SonarRing, office_world, simulate
from mcloc.simulation.derived_sonar import DerivedSonar
from mcloc.simulation.sonar import ring_angles


@pytest.mark.parametrize("n", [7, 16, 24])
def test_a_ring_looks_evenly_around(n):
    angles = ring_angles(n)
    assert np.diff(angles) == pytest.approx(2.0 * np.pi / n)
    assert angles == pytest.approx(-angles[::-1])
    assert SonarRing(beams=n).angles.tolist() == angles.tolist()


def test_a_ring_measures_the_nearest_of_its_cones_but_for_crosstalk():
    world = office_world(1)
    poses = simulate(world, 1, Scenario(length=5.0)).truth.poses[::20]
    exact = SonarRing(sigma_relative=0.0, missing=0.0, crosstalk=0.0)
    rays = Laser(
        beams=16, fov=2 * np.pi * 15 / 16, range_max=3.0, sigma=0.0, missing=0.0, mount=(0, 0, 0)
    )
    walls = exact.measure(world, poses, np.random.default_rng(1))
    assert (walls <= rays.measure(world, poses, np.random.default_rng(1)) + 1e-9).all()
    many = np.repeat(poses[:1], 2000, axis=0)
    noisy = SonarRing(sigma_relative=0.0, missing=0.0, crosstalk=0.2)
    echoes = noisy.measure(world, many, np.random.default_rng(2))
    other = ~np.isclose(echoes, walls[:1])
    # 32,000 readings: 4.5 deviations of a share of 0.2
    assert np.mean(other) == pytest.approx(0.2, abs=4.5 * np.sqrt(0.16 / echoes.size))


def test_a_robot_may_have_a_ring():
    drive = simulate(office_world(1), 1, Scenario(length=3.0, lasers=(SonarRing(beams=12),)))
    scans = [event for event in drive.events if isinstance(event, Scan)]
    assert scans[0].source == "sonars"
    assert scans[0].ranges.shape == (12,)


def test_ring_sizes_are_those_of_robots():
    with pytest.raises(ConfigError, match="7"):
        SonarRing(beams=6)
    with pytest.raises(ConfigError, match="7 to 24 sonars, got 25"):
        DerivedSonar(25)
    with pytest.raises(ConfigError, match="a cone of 0 to π"):
        DerivedSonar(16, cone=0.0)


def laser_scan(rng, first, step, n):
    ranges = rng.uniform(0.2, 9.0, n)
    ranges[rng.random(n) < 0.1] = np.inf
    ranges[rng.random(n) < 0.1] = 81.9
    ranges[rng.random(n) < 0.1] = np.nan
    ranges[rng.random(n) < 0.1] = 0.0
    return Scan(
        *(3.0, ranges, first + step * np.arange(n), 8.0, np.array([0.2, 0.0, 0.1])),
        odometry=np.ones(3),
        source="front",
    )


@pytest.mark.parametrize("sonars", [7, 16, 24])
@pytest.mark.parametrize(
    ("first", "step", "n"),
    [(-np.pi / 2, np.pi / 180, 181), (-np.pi, np.pi / 180, 360), (1.0, -0.01, 150)],
)
def test_a_derived_echo_is_the_nearest_return_in_the_cone(sonars, first, step, n):
    """Beside a loop over all beams."""
    cone, reach = np.radians(20.0), 5.0
    scan = laser_scan(np.random.default_rng(sonars), first, step, n)
    found = DerivedSonar(sonars, cone, reach).of(scan)
    angles, echoes = [], []
    for axis in ring_angles(sonars):
        off = [np.arctan2(np.sin(a - axis), np.cos(a - axis)) for a in scan.angles]
        edges = [min(abs(o - side * cone / 2) for o in off) for side in (-1, 1)]
        if max(edges) > abs(step) / 2 + 1e-9:
            continue  # a part of the cone is out of the laser's sight
        echo = np.nan
        for r, o in zip(scan.ranges, off, strict=True):
            if abs(o) <= cone / 2 + 1e-9 and not np.isnan(r) and r > 0.0:
                echo = np.fmin(echo, r if r < 8.0 else np.inf)
        angles.append(axis)
        echoes.append(np.inf if echo >= reach else echo)
    assert found.angles == pytest.approx(angles)
    assert np.array_equal(found.ranges, echoes, equal_nan=True)
    assert len(echoes) > 0
    assert found.source == "derived sonar (front)"
    assert found.range_max == reach
    assert found.t == 3.0
    assert found.mount is scan.mount
    assert found.odometry is scan.odometry


def test_all_around_every_sonar_of_the_ring_is_there():
    scan = laser_scan(np.random.default_rng(0), -np.pi, np.pi / 180, 360)
    assert len(DerivedSonar(24).of(scan).ranges) == 24


def test_a_laser_that_sees_no_whole_cone_gives_no_sonar():
    scan = laser_scan(np.random.default_rng(0), 0.0, 0.01, 20)
    assert len(DerivedSonar(24).of(scan).ranges) == 0
    assert len(DerivedSonar(24).of(laser_scan(np.random.default_rng(0), 0.0, 1.0, 1)).ranges) == 0


def test_of_a_log_scans_alone_are_exchanged():
    scan, wheels = laser_scan(np.random.default_rng(0), -1.0, 0.1, 20), Odometry(1.0, np.zeros(3))
    found = list(DerivedSonar(16).instead(iter([wheels, scan]), {}))
    assert found[0] is wheels
    assert found[1].source == "derived sonar (front)"
