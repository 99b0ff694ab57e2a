"""People walk through free space, at a walk, and around the robot rather than through it."""

import numpy as np
import pytest

from mcloc.errors import ConfigError
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation import Roadmap, follow, office_world
from mcloc.simulation.people import ASIDE, BERTH, RADIUS, SPEED, Crowd
from mcloc.trajectory import Trajectory

PEOPLE = 16


@pytest.fixture(scope="module")
def world() -> OccupancyGrid:
    return office_world(4)


@pytest.fixture(scope="module")
def roadmap(world: OccupancyGrid) -> Roadmap:
    return Roadmap(world)


@pytest.fixture(scope="module")
def robot(roadmap: Roadmap) -> Trajectory:
    return follow(roadmap.tour(40.0, np.random.default_rng(4)), 0.5)


@pytest.fixture(scope="module")
def places(roadmap: Roadmap, robot: Trajectory) -> np.ndarray:
    """(16, T, 2) at all times of the drive; the first eight are visitors."""
    crowd = Crowd(PEOPLE, roadmap, robot, np.random.default_rng(5))
    return crowd.at(robot.t, robot.poses)


def test_nobody_touches_a_wall(world: OccupancyGrid, places: np.ndarray) -> None:
    around = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)[:, None, None]
    x, y = np.moveaxis(places[:, ::4], -1, 0)
    rim = np.stack([x + RADIUS * np.cos(around), y + RADIUS * np.sin(around), 0 * (x + around)], -1)
    assert np.isfinite(places).all()
    assert world.free[world.cell_of(rim)].all()


def test_nobody_walks_into_the_robot(places: np.ndarray, robot: Trajectory) -> None:
    distance = np.linalg.norm(places - robot.poses[:, :2], axis=-1)
    assert distance.min() >= BERTH - 1e-9


def test_people_walk_at_a_walk_unless_they_step_aside(
    places: np.ndarray, robot: Trajectory
) -> None:
    speed = np.linalg.norm(np.diff(places, axis=1), axis=-1) / np.diff(robot.t)
    distance = np.linalg.norm(places - robot.poses[:, :2], axis=-1)
    alone = np.minimum(distance[:, :-1], distance[:, 1:]) > ASIDE
    assert speed[alone].max() <= SPEED[1] + 1e-9
    assert np.median(speed[alone & (speed > 0.0)]) > SPEED[0] - 0.1
    assert (speed == 0.0).mean() > 0.05  # they stop to look


def test_visitors_are_around_the_robot(places: np.ndarray, robot: Trajectory) -> None:
    distance = np.linalg.norm(places - robot.poses[:, :2], axis=-1)
    visitors, others = np.split(distance, 2)
    assert np.median(visitors) < 4.0 < np.median(others)


def test_someone_without_a_place_to_step_aside_is_not_there(roadmap: Roadmap) -> None:
    still = Trajectory(np.arange(3.0), np.tile([*roadmap.points[0], 0.0], (3, 1)))
    crowd = Crowd(1, roadmap, still, np.random.default_rng(0), visitors=0.0)
    far_from_all = np.array([[-50.0, -50.0, 0.0]])
    crowd._walks = [(np.array([0.0, 2.0]), np.full((2, 2), -50.0))]
    assert np.isnan(crowd.at(np.array([1.0]), far_from_all)).all()


@pytest.mark.parametrize(("n", "visitors"), [(-1, 0.5), (3, 1.5), (3, np.nan)])
def test_crowds_that_cannot_be(
    n: int, visitors: float, roadmap: Roadmap, robot: Trajectory
) -> None:
    with pytest.raises(ConfigError, match="people"):
        Crowd(n, roadmap, robot, np.random.default_rng(0), visitors=visitors)
