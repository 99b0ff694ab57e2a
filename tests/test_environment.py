"""Where a robot can stand: the uniform density over free cells and headings, or over tiles, and
p(x | m).
"""

import numpy as np
import pytest
from scipy.stats import chisquare, kstest

from mcloc.draws import Draws
from mcloc.environment import FreeSpace, Tiles
from mcloc.errors import ConfigError, MapError
from mcloc.geometry import compose
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

N = 20_000
ORIGIN = np.array([5.0, -3.0, 0.6])


@pytest.fixture
def grid():
    cells = np.random.default_rng(1).choice([FREE, OCCUPIED, UNKNOWN], (9, 14)).astype(np.int8)
    return OccupancyGrid(cells, 0.2, ORIGIN)


def test_every_free_cell_is_as_likely(grid):
    x = FreeSpace(grid).sample(Draws(1), 0, N)
    row, column = grid.cell_of(x.T)
    assert grid.free[row, column].all()
    observed = np.zeros(grid.cells.shape)
    np.add.at(observed, (row, column), 1)
    assert chisquare(observed[grid.free]).pvalue > 1e-4


def test_places_within_a_cell_and_headings_are_uniform(grid):
    x = FreeSpace(grid).sample(Draws(2), 0, N)
    within = np.mod(grid.to_grid(x.T)[:, :2] / grid.resolution, 1.0)
    assert kstest(within[:, 0], "uniform").pvalue > 1e-4
    assert kstest(within[:, 1], "uniform").pvalue > 1e-4
    assert kstest((x[2] + np.pi) / (2.0 * np.pi), "uniform").pvalue > 1e-4
    assert x[2].min() > -np.pi
    assert x[2].max() <= np.pi


def test_chunks_make_no_difference(grid):
    space = FreeSpace(grid)
    whole = space.sample(Draws(3), 4, 100)
    parts = [space.sample(Draws(3), 4, 30), space.sample(Draws(3), 34, 70)]
    assert np.array_equal(whole, np.concatenate(parts, axis=1))


def test_the_density_integrates_to_one(grid):
    """Over a grid of points five to a cell, the map turned, all headings."""
    side = np.arange(-5, 90) * 0.04 + 0.02
    local = np.stack([v.ravel() for v in np.meshgrid(side, side)] + [np.zeros(side.size**2)])
    x = np.ascontiguousarray(compose(ORIGIN, local.T).T)
    density = np.exp(FreeSpace(grid).log_density(x))
    assert density.sum() * 0.04**2 * 2.0 * np.pi == pytest.approx(1.0)


def test_samples_have_a_density_and_walls_have_none(grid):
    space = FreeSpace(grid)
    assert np.isfinite(space.log_density(space.sample(Draws(1), 0, 500))).all()
    outside = np.array([[100.0, -100.0], [0.0, 0.0], [0.0, 0.0]])
    assert (space.log_density(outside) == -np.inf).all()


def test_the_prior_is_that_of_the_cell(grid):
    """One pose in the middle of each cell, and one far off the map."""
    space = FreeSpace(grid, p_unknown=0.3, p_occupied=0.02)
    row, column = np.indices(grid.cells.shape)
    local = np.stack([(column + 0.5) * 0.2, (row + 0.5) * 0.2, 0.0 * row], axis=-1).reshape(-1, 3)
    x = np.ascontiguousarray(compose(ORIGIN, np.append(local, [[50.0, 0.0, 0.0]], axis=0)).T)
    expected = np.where(grid.free, 1.0, np.where(grid.occupied, 0.02, 0.3)).ravel()
    # 16 bits from log 1 to log 0.02.
    error = np.abs(space.log_prior(x) - np.log(np.append(expected, 0.3)))
    assert error.max() <= 0.5 * np.log(1.0 / 0.02) / 65535 + 1e-12


def test_a_map_without_free_cells():
    grid = OccupancyGrid(np.full((3, 3), UNKNOWN, dtype=np.int8), 0.1, np.zeros(3), name="fog.yaml")
    with pytest.raises(MapError, match=r"fog\.yaml: no free cell"):
        FreeSpace(grid).sample(Draws(1), 0, 1)


@pytest.mark.parametrize("shape", [(11,), (4, 6), (2, 1, 3, 2)])
def test_every_tile_is_as_likely(shape):
    x = Tiles(shape).sample(Draws(6), 0, N)
    assert x.shape == (len(shape), N)
    observed = np.zeros(shape)
    np.add.at(observed, tuple(x.astype(int)), 1)
    assert (x == np.floor(x)).all()
    assert chisquare(observed.ravel()).pvalue > 1e-4


def test_chunks_of_tiles_make_no_difference():
    tiles = Tiles((5, 7))
    parts = [tiles.sample(Draws(3), 4, 30), tiles.sample(Draws(3), 34, 70)]
    assert np.array_equal(tiles.sample(Draws(3), 4, 100), np.concatenate(parts, axis=1))


def test_tiles_share_all_there_is():
    """Whole numbers and the halves between them, from beyond one end to beyond the other."""
    x = 0.5 * np.indices((14, 18)).reshape(2, -1) - 1.0
    tile = (x == np.floor(x)).all(axis=0) & (x >= 0.0).all(axis=0) & (x[0] < 4) & (x[1] < 6)
    tiles = Tiles((4, 6))
    assert len(tiles) == tile.sum() == 24
    assert np.exp(tiles.log_density(x)) == pytest.approx(tile / 24.0)
    assert np.exp(tiles.log_prior(x)) == pytest.approx(1.0 * tile)
    assert np.array_equal(tiles.contain(x), tile)


def test_what_a_table_holds_for_each_tile():
    table = np.arange(24.0).reshape(4, 6) + 1.0
    x = np.array([[3.0, 0.0, -1.0, 4.0, 1.0, np.nan], [2.0, 5.0, 0.0, 0.0, 1.5, 0.0]])
    assert Tiles((4, 6)).at(table, x).tolist() == [21.0, 6.0, 0.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize("shape", [(), (0,), (3, -1), (2.5,), (1, 1, 1, 1, 1)])
def test_a_shape_that_cannot_be(shape):
    with pytest.raises(ConfigError, match="tiles need"):
        Tiles(shape)
