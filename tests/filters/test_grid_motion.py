"""Moves of a pose grid against moves of poses: mean, variance and mass, over hundreds of steps."""

from dataclasses import replace

import numpy as np
import pytest

from mcloc.filters.grid_belief import GridBelief
from mcloc.filters.grid_motion import moved
from mcloc.geometry import compose, wrap
from mcloc.kernels.blur import SIDE
from mcloc.maps.occupancy import FREE, OccupancyGrid
from mcloc.maps.pose_lattice import PoseLattice

CELL, SLICES = 0.2, 90
SILENT = np.zeros((3, 3))
ROUNDING = 240 * 2.0**-23  # of mass in as many steps, in float32
SLOW = np.diag([0.0009, 0.0004, 0.0002])  # m², m², rad²: deviations of 3 cm, 2 cm, 0.8°


@pytest.fixture(scope="module")
def lattice():
    """Over 12 m × 10 m, turned."""
    cells = np.full((50, 60), FREE, dtype=np.int8)
    return PoseLattice(OccupancyGrid(cells, 0.2, np.array([3.0, -4.0, 0.5])), CELL, SLICES)


def around(lattice, local, spread=0.0):
    """A belief in one cell, or in one and four around it; in all 1. local: in the grid's frame."""
    cells = np.zeros(lattice.size, dtype=np.float32)
    for x, y in ((0, 0), (spread, 0), (-spread, 0), (0, spread), (0, -spread)):
        pose = compose(lattice.grid.origin, np.add(local, [x, y, 0.0]))
        cells[lattice.cells_of(pose[:, None], np.zeros((SLICES, 2)), 0.0)] += 0.2
    return GridBelief(
        lattice, cells.reshape(lattice.shape), np.zeros((SLICES, 2)), 0.0, least=1e-12
    )


def mean_of(bel):
    x, w = bel.particles.states, bel.particles.weights
    return np.array([x[0] @ w, x[1] @ w, np.angle(np.exp(1j * x[2]) @ w)])


def covariance_of(bel):
    apart = bel.particles.states - mean_of(bel)[:, None]
    apart[2] = wrap(apart[2])
    return (apart * bel.particles.weights) @ apart.T


def mass(bel):
    return float(bel.cells.sum(dtype=np.float64))


@pytest.mark.parametrize("heading", [0.0, 0.7, 2.5, -1.6])
def test_hundreds_of_moves_much_smaller_than_a_cell_move_each_cell_as_they_should(lattice, heading):
    """Without noise no cell is touched: the path is that of a pose, in all slices."""
    bel = around(lattice, [6.0, 5.0, heading], spread=0.6)
    before, x = bel.cells.copy(), bel.particles.states.T
    for k in range(300):
        u = np.array([0.012, -0.003, 0.01 * np.cos(0.03 * k)])
        bel, x = moved(bel, u, SILENT), compose(x, u)
    assert bel.cells.tobytes() == before.tobytes()
    found = bel.particles.states.T
    assert found[:, :2] == pytest.approx(x[:, :2], abs=1e-9)
    assert wrap(found[:, 2] - x[:, 2]) == pytest.approx(0.0, abs=1e-9)


def test_forth_and_back_and_round_in_circles_is_nothing(lattice):
    bel = start = around(lattice, [6.0, 5.0, 1.0])
    for u in ([0.07, 0.0, 0.0], [-0.07, 0.0, 0.0], [0.0, 0.031, 0.0], [0.0, -0.031, 0.0]) * 30:
        bel = moved(bel, np.array(u), SILENT)
    for _ in range(3 * 40):
        bel = moved(bel, np.array([0.0, 0.0, 2.0 * np.pi / 40]), SILENT)
    assert np.array_equal(bel.cells, start.cells)
    assert bel.particles.states == pytest.approx(start.particles.states, abs=1e-9)


def test_driving_in_a_circle_comes_back(lattice):
    """Each heading on its own circle."""
    bel = start = around(lattice, [6.0, 5.0, -2.0])
    for _ in range(200):
        bel = moved(bel, np.array([0.03, 0.0, 2.0 * np.pi / 200]), SILENT)
    assert bel.particles.states == pytest.approx(start.particles.states, abs=1e-9)


@pytest.mark.parametrize("heading", [0.0, 0.4, 1.3])
@pytest.mark.parametrize("deviation", [1e-4, 0.003, 0.05, 0.3])
def test_noise_of_x_and_y_adds_up_exactly(lattice, heading, deviation):
    """Variances add up over 240 steps, or as many as leave all on the map; without noise of θ no
    slices merge, so that nothing is added.
    """
    c = np.diag([1.0, 0.09, 0.0]) * deviation**2
    n = int(min(240, (0.8 / deviation) ** 2))
    bel = start = around(lattice, [6.0, 5.0, heading])
    for _ in range(n):
        bel = moved(bel, np.array([0.004, 0.001, 0.0]), c)
    slice_at = start.particles.states[2, 0]
    turned = np.array([[np.cos(slice_at), -np.sin(slice_at)], [np.sin(slice_at), np.cos(slice_at)]])
    expected = turned @ (n * c[:2, :2]) @ turned.T
    found = covariance_of(bel) - covariance_of(start)
    assert mass(bel) == pytest.approx(1.0, abs=ROUNDING)
    assert found[:2, :2] == pytest.approx(expected, rel=2e-3, abs=2e-4 * n * deviation**2 + 1e-9)
    assert mean_of(bel)[:2] == pytest.approx(
        (mean_of(start)[:2] + n * turned @ [0.004, 0.001]), abs=1e-4
    )


@pytest.mark.parametrize("deviation", [0.001, 0.01, 0.08])
def test_noise_of_headings_adds_up_and_slices_that_merge_cost_what_is_said(lattice, deviation):
    """A robot that turns and does not move otherwise, in a grid that has moved before: at each step
    at most ¼ cell² of what changes the slice, which is at most C_θθ in slices².
    """
    n = int(min(240, (0.6 / deviation) ** 2))
    bel = around(lattice, [6.0, 5.0, 0.3])
    bel = start = moved(bel, np.array([1.37, 0.0, 0.0]), SILENT)
    c = np.diag([0.0, 0.0, deviation**2])
    for _ in range(n):
        bel = moved(bel, np.array([0.0, 0.0, 0.05]), c)
    found = covariance_of(bel) - covariance_of(start)
    assert mass(bel) == pytest.approx(1.0, abs=ROUNDING)
    assert found[2, 2] == pytest.approx(n * deviation**2, rel=2e-3)
    assert wrap(mean_of(bel)[2] - mean_of(start)[2] - 0.05 * n) == pytest.approx(0.0, abs=1e-4)
    slices = deviation**2 / lattice.sides[2] ** 2
    cost = np.diag(found)[:2] / CELL**2
    assert (cost >= -1e-4).all()
    assert (cost <= 0.25 * n * min(slices, 1.0) * 1.001 + 1e-4).all()
    assert cost.max() > 0.02 * n * min(slices, 1.0)  # or it would be said for nothing
    assert mean_of(bel)[:2] == pytest.approx(mean_of(start)[:2], abs=2e-3 * CELL)


def particles_after(start, u, c, n, count=40_000):
    """(3, count): the same moves with normal noise, pose by pose."""
    rng = np.random.default_rng(11)
    x, root = np.tile(start, (count, 1)), np.linalg.cholesky(c)
    for k in range(n):
        x = compose(x, u(k) + rng.normal(size=(count, 3)) @ root.T)
    return x.T


@pytest.mark.parametrize("cell", [0.2, 0.1])
def test_a_drive_of_200_steps_agrees_with_particles(lattice, cell):
    """Sub-cell moves with noise in all axes. The mean agrees within 5 standard errors of the
    particles' and the curvature within a slice; the deviations within what merging may add.
    """
    lattice = replace(lattice, cell=cell)
    n, c = 200, SLOW.copy()
    c[1, 2] = c[2, 1] = 0.0001  # what turns early comes to lie aside

    def u(k):
        return np.array([0.02, 0.0, 0.025])

    bel = around(lattice, [6.0, 5.0, 0.3])
    start = bel.particles.states[:, 0]
    variance = covariance_of(bel)
    for k in range(n):
        bel = moved(bel, u(k), c)
    x = particles_after(start, u, c, n)
    expected = np.array([x[0].mean(), x[1].mean(), np.angle(np.exp(1j * x[2]).mean())])
    apart = x - expected[:, None]
    apart[2] = wrap(apart[2])
    spread = apart @ apart.T / x.shape[1]
    assert mass(bel) == pytest.approx(1.0, abs=ROUNDING)
    off = mean_of(bel) - expected
    off[2] = wrap(off[2])
    assert (np.abs(off) < 5.0 * np.sqrt(np.diag(spread) / x.shape[1]) + [0.01, 0.01, 1e-3]).all()
    slices = c[2, 2] / lattice.sides[2] ** 2
    most = n * 0.25 * slices * cell**2
    found = np.diag(covariance_of(bel) - variance)
    assert found[2] == pytest.approx(spread[2, 2], rel=0.04)
    assert (found[:2] > 0.96 * np.diag(spread)[:2]).all()
    assert (found[:2] < 1.04 * np.diag(spread)[:2] + most).all()


def test_passive_cells_are_shifted_and_not_blurred(lattice):
    bel = around(lattice, [6.0, 5.0, 0.3])
    faint = around(lattice, [2.0, 2.0, -2.0]).cells * np.float32(1e-6)
    both = replace(bel, cells=bel.cells + faint, least=1e-3)
    after = moved(both, np.array([0.3, 0.1, 0.02]), SLOW)
    assert after.cells[faint > 0.0].tobytes() == faint[faint > 0.0].tobytes()
    assert mass(after) == pytest.approx(mass(both), abs=1e-6)
    alone = moved(replace(bel, least=1e-3), np.array([0.3, 0.1, 0.02]), SLOW)
    assert after.particles.states == pytest.approx(alone.particles.states)


def test_mass_is_conserved_across_the_border_of_what_is_active(lattice):
    """What lies below the border takes from above, and gives when it rises; all the while the sum
    is 1.
    """
    bel = replace(around(lattice, [6.0, 5.0, 0.3]), least=1e-3)
    for _ in range(60):
        bel = moved(bel, np.array([0.01, 0.0, 0.01]), SLOW)
        assert mass(bel) == pytest.approx(1.0, abs=ROUNDING)
    passive = bel.cells <= bel.least
    assert 0.001 < bel.cells[passive].sum() < 0.5


def test_what_leaves_the_grid_is_lost(lattice):
    """A cell, another 1 m behind it, two beside that and one behind drive over the edge."""
    bel = around(lattice, [6.1, 5.1, 0.0], spread=1.0)
    edge = lattice.shape[2] * CELL - SIDE * CELL
    for beyond, left in ((-1.1, 1.0), (-0.9, 0.8), (-0.05, 0.8), (0.15, 0.2), (1.15, 0.0)):
        far = edge - 6.1 + beyond
        at_once = moved(bel, np.array([far, 0.0, 0.0]), SILENT)
        assert mass(at_once) == pytest.approx(left, abs=1e-6)
        steps = bel
        for _ in range(100):
            steps = moved(steps, np.array([far / 100, 0.0, 0.0]), SILENT)
        assert mass(steps) == pytest.approx(left, abs=1e-6)
    for far in (1e3, 1e6):
        assert mass(moved(bel, np.array([far, 0.0, 0.0]), SILENT)) == 0.0


def test_threads_do_not_matter(lattice, set_threads):
    found = []
    for threads in (1, 2):
        set_threads(threads)
        bel = around(lattice, [6.0, 5.0, 0.3], spread=1.0)
        for _ in range(20):
            bel = moved(bel, np.array([0.05, 0.0, 0.04]), 4.0 * SLOW)
        found.append((bel.cells.tobytes(), bel.offsets.tobytes(), bel.active.tobytes()))
    assert found[0] == found[1]
