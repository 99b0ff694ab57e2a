"""Routes: as long as asked, short, and clear of walls."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

from mcloc.errors import ConfigError, MapError
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.simulation import Roadmap, follow, office_world, tour
from mcloc.simulation.route import CLEARANCE, RASTER

SPEED = 0.5  # m/s


@pytest.mark.parametrize("seed", range(4))
def test_a_tour_is_as_long_as_asked_and_drivable_without_a_touch(seed: int) -> None:
    world = office_world(seed)
    route = tour(world, 40.0, seed)
    assert 40.0 - 1.5 * RASTER < sum(np.hypot(*(b - a)) for a, b in pairwise(route)) <= 40.0

    path = follow(route, SPEED)
    x, y, theta = path.poses.T
    around = np.linspace(0.0, 2.0 * np.pi, 32)[:, None]
    rim = np.stack([x + 0.25 * np.cos(around), y + 0.25 * np.sin(around), theta + 0 * around], -1)
    assert world.free[world.cell_of(rim)].all()


def test_a_tour_needs_room() -> None:
    walls = OccupancyGrid(np.full((9, 9), OCCUPIED, np.int8), 0.05, np.zeros(3), name="solid.yaml")
    with pytest.raises(MapError, match=r"solid\.yaml.*0\.35 m clear"):
        tour(walls, 10.0, 0)


def test_a_corner_too_small_to_drive_in_is_no_room() -> None:
    cells = np.full((60, 60), OCCUPIED, np.int8)
    cells[10:30, 10:30] = FREE  # 1 m × 1 m, of which 0.3 m × 0.3 m are clear
    with pytest.raises(MapError, match="no robot can drive here"):
        Roadmap(OccupancyGrid(cells, 0.05, np.zeros(3)))


@pytest.mark.parametrize("length", [0.0, -1.0, np.nan, np.inf])
def test_a_tour_has_a_length(length: float) -> None:
    with pytest.raises(ConfigError, match="length"):
        tour(office_world(0), length, 0)


@pytest.fixture(scope="module")
def roadmap() -> Roadmap:
    return Roadmap(office_world(2))


def test_a_way_is_the_cheapest_one(roadmap: Roadmap) -> None:
    rng = np.random.default_rng(0)
    start = roadmap.random(rng)
    least = dijkstra(roadmap._graph, indices=start)
    for _ in range(20):
        goal = roadmap.random(rng)
        way = roadmap.way(start, goal)
        assert (way[0], way[-1]) == (start, goal)
        cost = sum(roadmap._graph[a, b] for a, b in pairwise(way))
        assert cost == pytest.approx(least[goal])
        steps = np.linalg.norm(np.diff(roadmap.points[way], axis=0), axis=1)
        assert (steps <= RASTER * np.sqrt(2) + 1e-9).all()


def test_the_way_to_where_one_is_already(roadmap: Roadmap) -> None:
    assert roadmap.way(5, 5) == [5]


def test_one_sees_no_further_than_the_walls(roadmap: Roadmap) -> None:
    at = [roadmap.nearest(np.array(p)) for p in ([2.0, 6.9], [17.0, 6.9], [17.0, 12.5])]
    assert roadmap.sees(at[0], at[1])  # along the corridor
    assert not roadmap.sees(at[0], at[2])  # into a room


def test_places_lie_where_the_map_lies() -> None:
    flat = office_world(1)
    turned = OccupancyGrid(flat.cells, flat.resolution, np.array([5.0, -3.0, 2.0]))
    points = Roadmap(turned).points
    poses = np.column_stack([points, np.zeros(len(points))])
    assert turned.free[turned.cell_of(poses)].all()
    np.testing.assert_allclose(
        turned.to_grid(poses)[:, :2], Roadmap(flat).points - flat.origin[:2], atol=1e-9
    )


def test_places_are_as_clear_of_walls_as_they_should_be(roadmap: Roadmap) -> None:
    world = office_world(2)
    row, column = np.nonzero(~world.free)
    walls = np.stack([column + 0.5, row + 0.5], axis=-1) * world.resolution + world.origin[:2]
    for point in roadmap.points[::50]:
        assert np.hypot(*(walls - point).T).min() > CLEARANCE - 1e-9
