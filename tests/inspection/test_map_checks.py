"""Maps: each fault planted in worlds and in real maps is found, and nothing in the maps as is."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from mcloc.inspection import describe_map, inspect_map
from mcloc.inspection.map_checks import depth
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation import museum_world, office_world

REAL = [
    *("wean/wean.dat.gz", "intel/intel_train.yaml", "intel/intel_full.yaml"),
    *("fhw/fhw_train.yaml", "fhw/fhw_full.yaml", "freiburg-079/freiburg-079_train.yaml"),
    *("malaga/map.yaml", "maps/nav2_depot.yaml", "maps/nav2_warehouse.yaml", "maps/willow.yaml"),
]
NOTHING_UNKNOWN = ("freiburg-079/freiburg-079_train.yaml", "maps/nav2_depot.yaml")


def checks(grid: OccupancyGrid) -> list[str]:
    return [finding.check for finding in inspect_map(grid)]


def negated(grid: OccupancyGrid) -> OccupancyGrid:
    """As `negate` does it: grey, which was unknown, becomes a wall."""
    return replace(grid, cells=np.where(grid.occupied, 0, 100))


def swapped(grid: OccupancyGrid) -> OccupancyGrid:
    """The same, but the unknown stays unknown."""
    return replace(grid, cells=np.where(grid.unknown, -1, np.where(grid.free, 100, 0)))


def walled(grid: OccupancyGrid) -> OccupancyGrid:
    return replace(grid, cells=np.where(grid.unknown, 100, grid.cells))


@pytest.mark.parametrize("world", [office_world, museum_world])
@pytest.mark.parametrize("seed", range(10))
def test_worlds_are_right_until_they_are_spoilt(world, seed: int) -> None:
    grid = world(seed)
    assert checks(grid) == []
    assert checks(negated(grid)) == ["map-inverted"]
    assert checks(swapped(grid)) == ["map-inverted"]
    assert checks(walled(grid)) == ["map-unknown-as-walls"]
    assert checks(replace(grid, resolution=10.0 * grid.resolution)) == ["map-resolution"]
    assert checks(replace(grid, resolution=0.1 * grid.resolution)) == ["map-resolution"]
    assert checks(replace(grid, cells=np.minimum(grid.cells, 0))) == ["map-nothing-occupied"]
    assert checks(replace(grid, cells=np.where(grid.free, -1, grid.cells))) == ["map-nothing-free"]


@pytest.mark.parametrize("name", REAL)
def test_real_maps_are_right_until_they_are_spoilt(data_dir: Path, name: str) -> None:
    grid = OccupancyGrid.load(data_dir / name)
    assert checks(grid) == []
    assert checks(negated(grid)) == ["map-inverted"]
    assert checks(swapped(grid)) == ["map-inverted"]
    if name not in NOTHING_UNKNOWN:
        assert checks(walled(grid)) == ["map-unknown-as-walls"]


def test_depth_against_all_distances() -> None:
    rng = np.random.default_rng(1)
    kind = np.kron(rng.random((6, 5)) < 0.5, np.ones((3, 3))) > 0
    grid = OccupancyGrid(np.where(kind, 100, 0), 0.2, np.zeros(3))
    nearest = cdist(np.argwhere(kind), np.argwhere(~kind)).min(axis=1)
    assert depth(grid, grid.occupied) == pytest.approx(0.2 * np.percentile(nearest, 90.0))


def test_numbers_of_a_map() -> None:
    cells = np.array([[0, 0, 100], [-1, 0, -1]])
    grid = OccupancyGrid(cells, 0.5, np.array([1.0, 2.0, 0.1]))
    told = describe_map(grid)
    assert (told["width_m"], told["height_m"], told["columns"], told["rows"]) == (1.5, 1.0, 3, 2)
    shares = (told["free"], told["occupied"], told["unknown"])
    assert shares == pytest.approx((3 / 6, 1 / 6, 2 / 6))
    assert told["origin"] == {"x": 1.0, "y": 2.0, "theta": 0.1}


def test_a_map_of_nothing_but_unknown_cells() -> None:
    grid = OccupancyGrid(np.full((5, 5), -1), 0.05, np.zeros(3))
    assert checks(grid) == ["map-nothing-occupied"]
