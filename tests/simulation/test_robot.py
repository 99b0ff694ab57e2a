"""How the simulated robot drives, and how its wheels and laser err."""

from itertools import pairwise

import numpy as np
import pytest

from mcloc.errors import ConfigError, MapError
from mcloc.geometry import between, compose
from mcloc.maps.occupancy import OCCUPIED, OccupancyGrid
from mcloc.simulation import Laser, Wheels, follow, office_world, ranges, tour
from mcloc.simulation.robot import LOOKAHEAD, STEP, TURN_MAX

SPEED = 0.5  # m/s
PERFECT = Wheels(scale=0.0, drift=0.0, sigma_distance=0.0, sigma_turn=0.0, sigma_drift=0.0)


def straight(metres: float, steps: int) -> np.ndarray:
    return np.column_stack([np.linspace(0.0, metres, steps + 1), np.zeros((steps + 1, 2))])


@pytest.mark.parametrize("seed", range(4))
def test_a_tour_is_as_long_as_asked_and_drivable_without_a_touch(seed: int) -> None:
    world = office_world(seed)
    route = tour(world, 40.0, seed)
    assert 39.9 < sum(np.hypot(*(b - a)) for a, b in pairwise(route)) <= 40.0

    path = follow(route, SPEED)
    x, y, theta = path.poses.T
    around = np.linspace(0.0, 2.0 * np.pi, 32)[:, None]
    rim = np.stack([x + 0.25 * np.cos(around), y + 0.25 * np.sin(around), theta + 0 * around], -1)
    assert world.free[world.cell_of(rim)].all()


def test_a_tour_needs_room() -> None:
    walls = OccupancyGrid(np.full((9, 9), OCCUPIED, np.int8), 0.05, np.zeros(3), name="solid.yaml")
    with pytest.raises(MapError, match=r"solid\.yaml.*0\.35 m clear"):
        tour(walls, 10.0, 0)


def test_the_robot_keeps_to_its_speed_and_turns_smoothly_to_the_end() -> None:
    path = follow([[0.0, 0.0], [5.0, 0.0], [5.0, 5.0], [2.0, 0.0]], SPEED)
    motion = between(path.poses[:-1], path.poses[1:])
    assert np.hypot(motion[:, 0], motion[:, 1]).max() <= SPEED * STEP + 1e-12
    assert np.abs(motion[:, 2]).max() <= TURN_MAX * STEP + 1e-12
    assert np.hypot(*(path.poses[-1, :2] - [2.0, 0.0])) <= LOOKAHEAD
    np.testing.assert_allclose(np.diff(path.t), STEP)


@pytest.mark.parametrize(
    ("route", "speed"),
    [
        ([[0.0, 0.0]], 0.5),
        ([[0.0, 0.0], [0.1, 0.1]], 0.5),
        ([0.0, 1.0], 0.5),
        ([[0.0, 0.0], [np.nan, 1.0]], 0.5),
        ([[0.0, 0.0], [3.0, 0.0]], 0.0),
    ],
)
def test_a_route_that_leads_nowhere_is_refused(route: list[list[float]], speed: float) -> None:
    with pytest.raises(ConfigError, match=r"route|speed"):
        follow(route, speed)


def test_perfect_wheels_report_the_drive_in_a_frame_of_their_own() -> None:
    truth = follow([[3.0, 1.0], [6.0, 1.0], [6.0, 4.0], [2.0, 3.0]], SPEED).poses
    odometry = PERFECT.measure(truth, np.random.default_rng(0))
    np.testing.assert_allclose(compose(truth[0], odometry), truth, atol=1e-9)


def test_biases_are_per_metre_and_per_radian() -> None:
    wheels = Wheels(0.02, 0.01, 0.0, 0.0, 0.0)
    odometry = wheels.measure(straight(1.0, 1), np.random.default_rng(0))
    np.testing.assert_allclose(odometry[-1], [1.02, 0.0, 0.01], atol=1e-12)
    turn = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(wheels.measure(turn, np.random.default_rng(0))[-1, 2], 1.02)


@pytest.mark.parametrize("steps", [2, 200])
def test_deviations_grow_with_the_root_of_the_distance_however_it_is_cut(steps: int) -> None:
    wheels = Wheels(0.0, 0.0, sigma_distance=0.03, sigma_turn=0.0, sigma_drift=0.02)
    rng = np.random.default_rng(1)
    n = 2000
    ends = np.array([wheels.measure(straight(4.0, steps), rng)[-1] for _ in range(n)])
    five_sigma = 5.0 / np.sqrt(2 * n)  # relative, of a standard deviation from n samples
    assert ends[:, 2].std() == pytest.approx(0.02 * 2.0, rel=five_sigma)
    # What the heading's error costs in x is of second order: 4 m · 0.04² / 4 < 2 mm.
    assert ends[:, 0].std() == pytest.approx(0.03 * 2.0, rel=five_sigma, abs=0.002)


def test_the_laser_errs_by_sigma_and_misses_as_many_as_it_says() -> None:
    world, laser = office_world(0), Laser(sigma=0.03, missing=0.1, range_max=30.0)
    robot = np.tile([10.0, 7.0, 0.4], (50, 1))
    measured = laser.measure(world, robot, np.random.default_rng(2))
    exact = ranges(world, compose(robot, laser.mount), laser.angles, laser.range_max)
    returned = np.isfinite(measured)
    n = measured.size
    assert (~returned).mean() == pytest.approx(0.1, abs=5 * np.sqrt(0.1 * 0.9 / n))
    errors = (measured - exact)[returned]
    assert errors.std() == pytest.approx(0.03, rel=5 / np.sqrt(2 * n))
    assert abs(errors.mean()) < 5 * 0.03 / np.sqrt(returned.sum())


@pytest.mark.parametrize(
    "make",
    [
        lambda: Wheels(sigma_drift=-0.1),
        lambda: Wheels(sigma_turn=float("nan")),
        lambda: Laser(beams=90),
        lambda: Laser(range_max=0.0),
        lambda: Laser(missing=1.5),
    ],
)
def test_what_cannot_be_right_is_refused(make: object) -> None:
    with pytest.raises(ConfigError):
        make()  # type: ignore[operator]
