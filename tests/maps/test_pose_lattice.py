"""The cells of a pose grid: where they lie, before and after they were moved."""

import numpy as np
import pytest

from mcloc.geometry import wrap
from mcloc.kernels.blur import SIDE
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.maps.pose_lattice import PoseLattice


def grid(shape=(31, 44), origin=(5.0, -3.0, 2.8)):
    cells = np.random.default_rng(1).choice([FREE, OCCUPIED], shape)
    return OccupancyGrid(cells.astype(np.int8), 0.1, np.array(origin))


@pytest.fixture(params=[(0.2, 12), (0.07, 5), (0.5, 90)], ids=str)
def lattice(request):
    """Of a turned map, none of whose sides is a multiple of a cell."""
    return PoseLattice(grid(), *request.param)


def moved(lattice, seed):
    """Offsets and a turn as after many moves."""
    rng = np.random.default_rng(seed)
    _, height, width = lattice.shape
    return rng.uniform(0.0, (width, height), (lattice.slices, 2)), rng.uniform(-np.pi, np.pi)


def where(lattice, seed):
    return moved(lattice, seed) if seed else (np.zeros((lattice.slices, 2)), 0.0)


def test_it_reaches_a_block_beyond_the_map_on_all_sides(lattice):
    count, height, width = lattice.shape
    assert count == lattice.slices
    assert height % SIDE == width % SIDE == 0
    x = lattice.poses(np.arange(lattice.size), *where(lattice, 0))
    local = lattice.grid.to_grid(x.T)
    margin = lattice.cell * SIDE
    assert local[:, :2].min(axis=0) == pytest.approx(0.5 * lattice.cell - margin)
    height, width = np.array(lattice.grid.cells.shape) * lattice.grid.resolution
    assert (local[:, :2].max(axis=0) >= np.array([width, height]) + margin - lattice.cell).all()


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_middle_of_a_cell_lies_in_it(lattice, seed):
    cells = np.arange(lattice.size)
    at = where(lattice, seed)
    x = lattice.poses(cells, *at)
    assert (np.abs(x[2]) <= np.pi).all()
    found = lattice.cells_of(x, *at)
    assert np.array_equal(found, cells)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_pose_is_within_half_a_cell_of_the_middle_of_its_own(lattice, seed):
    rng = np.random.default_rng(3)
    x = np.stack([rng.uniform(1, 4, 4000), rng.uniform(-4, 0, 4000), rng.uniform(-9, 9, 4000)])
    at = where(lattice, seed)
    cells = lattice.cells_of(x, *at)
    inside = cells >= 0
    assert inside.mean() > 0.5
    apart = (lattice.grid.to_grid(x.T) - lattice.grid.to_grid(lattice.poses(cells, *at).T))[inside]
    _, height, width = lattice.shape
    # A cell on the seam lies half on one side of the grid and half on the other.
    apart[:, 0] = np.remainder(apart[:, 0] / lattice.cell + width / 2, width) - width / 2
    apart[:, 1] = np.remainder(apart[:, 1] / lattice.cell + height / 2, height) - height / 2
    assert np.abs(apart[:, :2]).max() <= 0.5 + 1e-9
    assert np.abs(wrap(apart[:, 2])).max() <= 0.5 * lattice.sides[2] + 1e-9


def test_offsets_move_a_slice_and_a_turn_all_of_them(lattice):
    """A cell in the middle of the map."""
    _, height, width = lattice.shape
    k = lattice.slices - 1
    cell = np.array([(k * height + height // 2) * width + width // 2])
    offsets = np.zeros((lattice.slices, 2))
    before = lattice.grid.to_grid(lattice.poses(cell, offsets, 0.0).T)[0]
    offsets[k] = 0.3, -0.8
    after = lattice.grid.to_grid(lattice.poses(cell, offsets, 0.25).T)[0]
    assert (after - before)[:2] == pytest.approx(lattice.cell * offsets[k])
    assert wrap(after[2] - before[2]) == pytest.approx(0.25)
    others = np.array([height // 2 * width + width // 2])
    same = (lattice.poses(others, offsets * o, 0.0) for o in (0.0, 1.0))
    assert np.array_equal(*same)


def test_beyond_the_grid_there_is_no_cell(lattice):
    x = np.array([[500.0, 5.0, -500.0], [0.0, 900.0, 3.0], [0.0, 0.0, 0.0]])
    assert (lattice.cells_of(x, *where(lattice, 0)) == -1).all()


def test_the_uniform_mass_of_a_cell():
    """All cells in free space have it together once."""
    cells = np.full((40, 60), FREE, dtype=np.int8)
    cells[:, 30:] = OCCUPIED
    lattice = PoseLattice(OccupancyGrid(cells, 0.1, np.zeros(3)), 0.2, 16)
    assert lattice.uniform == pytest.approx(1.0 / (20 * 15 * 16))
    assert lattice.sides.tolist() == [0.2, 0.2, 2.0 * np.pi / 16]
