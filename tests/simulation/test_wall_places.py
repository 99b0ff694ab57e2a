"""Places along the walls of a map."""

from dataclasses import replace

import numpy as np
import pytest

from mcloc.errors import MapError
from mcloc.geometry import compose
from mcloc.maps.occupancy import FREE, OccupancyGrid
from mcloc.simulation import office_world
from mcloc.simulation.wall_places import wall_places


@pytest.mark.parametrize("n", [1, 6])
def test_they_are_free_and_at_a_wall_also_of_a_map_that_lies_askew(n: int) -> None:
    grid = replace(office_world(1), origin=np.array([3.0, -2.0, 0.5]))
    places = wall_places(grid, n, np.random.default_rng(4))
    assert places.shape == (n, 2)
    steps = grid.resolution * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    for x, y in places:
        assert grid.state_at([x, y, 0.0]) == "free"
        beside = compose(np.array([x, y, 0.5]), steps)
        assert any(grid.state_at(place) == "occupied" for place in beside)


def test_they_are_far_from_each_other() -> None:
    places = wall_places(office_world(1), 6, np.random.default_rng(4))
    off = places[:, None] - places[None]
    apart = np.hypot(off[..., 0], off[..., 1])[np.triu_indices(6, 1)]
    assert apart.min() > 4.0  # the floor is 20 m x 15 m


def test_a_world_without_walls() -> None:
    empty = OccupancyGrid(np.full((40, 40), FREE, dtype=np.int8), 0.05, np.zeros(3), name="empty")
    with pytest.raises(MapError, match=r"empty: its walls have no room for 4 things; 0 of"):
        wall_places(empty, 4, np.random.default_rng(1))
