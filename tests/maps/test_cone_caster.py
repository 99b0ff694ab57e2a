"""The nearest wall in a cone, against rays of the simulator's own caster, which is plain NumPy."""

from dataclasses import replace

import numpy as np
import pytest

from mcloc.geometry import compose
from mcloc.maps.cone_caster import APART, ConeCaster, nearest_around
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.maps.ray_caster import RayCaster
from mcloc.simulation.ranges import ranges

CELL, REACH = 0.1, 3.0
CONES = np.radians([1.0, 8.0, 20.0, 50.0, 180.0])
ORIGINS = [(0.0, 0.0, 0.0), (3.0, -2.0, 0.7)]
MOUNTS = [(0.0, 0.0, 0.0), (0.2, -0.1, 2.0)]
ANGLES = np.array([-2.9, -1.0, 0.0, 0.1, 1.7, 3.1])


def blocks(origin=(0.0, 0.0, 0.0), side=4):
    """A walled room of 5.6 m × 4 m with blocks of side × side cells; all of it is known."""
    rng = np.random.default_rng(3)
    coarse = np.where(rng.random((40 // side, 56 // side)) < 0.12, OCCUPIED, FREE)
    cells = np.pad(coarse.repeat(side, axis=0).repeat(side, axis=1), side, constant_values=OCCUPIED)
    return OccupancyGrid(cells.astype(np.int8), CELL, np.array(origin))


def some_poses(grid, n=150):
    """(3, n) in free cells."""
    rng = np.random.default_rng(4)
    rows, columns = np.nonzero(grid.free)
    some = rng.integers(len(rows), size=n)
    local = np.stack([columns[some], rows[some], np.zeros(n)], axis=1) + rng.random((n, 3))
    local *= [CELL, CELL, 2.0 * np.pi]
    return np.ascontiguousarray(compose(grid.origin, local).T)


def fan_of_the_simulator(grid, x, mount, cone, rays):
    """(rays, n, B): so many rays of each beam, evenly from one edge of the cone to the other."""
    sensor = compose(x.T, mount)
    asides = np.linspace(-cone / 2.0, cone / 2.0, rays)
    return np.array([ranges(grid, sensor, ANGLES + aside, REACH) for aside in asides])


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("mount", MOUNTS, ids=str)
@pytest.mark.parametrize("origin", ORIGINS, ids=str)
def test_is_the_least_of_rays_up_to_4_degrees_apart(origin, mount, cone):
    grid = blocks(origin)
    x = some_poses(grid, 40)
    rays = 1 + 2 * int(np.ceil(cone / 2.0 / np.radians(4.0) - 1e-9))
    expected = fan_of_the_simulator(grid, x, mount, cone, rays).min(axis=0)
    found = ConeCaster(RayCaster(grid), cone).ranges(x, np.array(mount), ANGLES, REACH)
    assert found == pytest.approx(expected, abs=1e-9)
    assert np.isfinite(expected).any()


@pytest.mark.parametrize("cone", CONES[1:])
def test_misses_no_wall_in_the_cone_that_is_wide_enough(cone):
    """Walls of 0.4 m, wider than 4° at 3 m. From the nearest point, a wall recedes at 45° or more
    to at least one side, where a ray is up to 4° away: that is longer by sin 45° / sin 41° at most.
    """
    grid = blocks()
    x = some_poses(grid, 60)
    nearest = fan_of_the_simulator(grid, x, np.zeros(3), cone, 501).min(axis=0)
    found = ConeCaster(RayCaster(grid), cone).ranges(x, np.zeros(3), ANGLES, REACH)
    longer = np.sin(np.pi / 4.0) / np.sin(np.pi / 4.0 - APART)
    finely = np.sin(np.pi / 4.0) / np.sin(np.pi / 4.0 - cone / 500.0)  # so does the other fan
    assert (found * finely >= nearest - 1e-9).all()
    seen = nearest < REACH / longer
    assert (found <= longer * nearest + 1e-9)[seen].all()
    assert seen.mean() > 0.5


def test_both_edges_belong_to_the_cone():
    """A wall that ends just within, and just outside, of 10° to the left at 2 m."""
    for off, seen in ((-0.01, True), (0.01, False)):
        cells = np.full((40, 40), FREE, dtype=np.int8)
        cells[20:, 30] = OCCUPIED  # from y = 2 m on, at x = 3 m
        grid = OccupancyGrid(cells, CELL, np.zeros(3))
        x = np.array([[1.0], [2.0 - 2.0 * np.tan(np.radians(10.0) + off)], [0.0]])
        found = ConeCaster(RayCaster(grid), np.radians(20.0)).ranges(x, np.zeros(3), [0.0], 9.0)
        assert np.isfinite(found).all() == seen


def by_the_unknown(reach, heading):
    """What a cone of 20° sees at 1 m of a wall 1.5 m away to the left, the unknown to the right."""
    cells = np.full((40, 40), UNKNOWN, dtype=np.int8)
    cells[10:30, 10:25] = FREE
    cells[20:30, 25] = OCCUPIED
    grid = OccupancyGrid(cells, CELL, np.zeros(3))
    x = np.array([[1.0], [2.0], [heading]])
    return ConeCaster(RayCaster(grid), np.radians(20.0)).ranges(x, np.zeros(3), [0.0], reach)[0, 0]


def test_what_leaves_known_space_leaves_the_rest_of_the_cone_to_decide():
    assert by_the_unknown(9.0, 0.0) == pytest.approx(1.5)
    assert by_the_unknown(9.0, 0.1) == pytest.approx(1.5 / np.cos(np.radians(10.0) - 0.1), rel=0.02)
    assert np.isnan(by_the_unknown(9.0, -0.3))  # all of it leaves
    assert by_the_unknown(1.4, 0.0) == np.inf  # none does before 1.4 m
    assert by_the_unknown(1.505, 0.0) == pytest.approx(1.5)


def test_a_wall_beyond_reach_beside_the_unknown_is_no_wall_in_reach():
    cells = np.full((40, 60), FREE, dtype=np.int8)
    cells[:, 50] = OCCUPIED
    cells[:20, 20:] = UNKNOWN
    grid = OccupancyGrid(cells, CELL, np.zeros(3))
    x = np.array([[1.0], [2.0], [0.0]])
    cone = ConeCaster(RayCaster(grid), np.radians(20.0))
    assert cone.ranges(x, np.zeros(3), [0.0], REACH).tolist() == [[np.inf]]
    assert cone.ranges(x, np.zeros(3), [0.0], 9.0) == pytest.approx(4.0)


def test_a_sensor_in_a_wall_measures_0_and_off_the_map_nothing_is_known():
    grid = blocks()
    x = np.array([[0.05, -3.0, np.nan], [0.05, 1.0, 1.0], [0.3, 0.3, 0.3]])
    found = ConeCaster(RayCaster(grid), 0.4).ranges(x, np.zeros(3), [0.0, 1.0], REACH)
    np.testing.assert_array_equal(found, [[0.0, 0.0], [np.nan] * 2, [np.nan] * 2])


@pytest.mark.parametrize("spacing", [0.04, 0.5])
def test_a_sum_is_over_all_beams_each_with_its_function(spacing):
    """Linear between the knots; some beams have no wall in reach, some leave known space."""
    grid = replace(blocks(), cells=np.where(np.arange(64) > 50, UNKNOWN, blocks().cells))
    cone, x = ConeCaster(RayCaster(grid), np.radians(20.0)), some_poses(grid)
    e = cone.ranges(x, np.zeros(3), ANGLES, REACH)
    knots = 2 + int(REACH / spacing)
    table = np.random.default_rng(5).normal(size=(len(ANGLES), knots + 2)).astype(np.float32)
    expected = np.zeros(x.shape[1])
    for b, row in enumerate(table.astype(float)):
        value = np.interp(e[:, b], spacing * np.arange(knots), row[:knots])
        value[np.isinf(e[:, b])] = row[knots]
        value[np.isnan(e[:, b])] = row[knots + 1]
        expected += value
    found = cone.sum(x, np.zeros(3), ANGLES, REACH, table, spacing)
    assert found == pytest.approx(expected, abs=1e-5)
    assert min(np.isnan(e).sum(), np.isinf(e).sum()) > 5


def test_nobody_sees_nothing():
    cone = ConeCaster(RayCaster(blocks()), 0.3)
    assert cone.ranges(np.ones((3, 4)), np.zeros(3), [], REACH).shape == (4, 0)
    empty = np.zeros((0, 9), dtype=np.float32)
    assert cone.sum(np.ones((3, 4)), np.zeros(3), [], REACH, empty, 0.1).tolist() == [0.0] * 4
    table = np.zeros((1, 90), dtype=np.float32)
    assert cone.sum(np.ones((3, 0)), np.zeros(3), [0.0], REACH, table, 0.1).shape == (0,)


@pytest.mark.parametrize("aside", [1, 2, 5, 17])
def test_nearest_around_goes_round_the_circle(aside):
    rng = np.random.default_rng(6)
    lengths = rng.uniform(0.0, 5.0, (30, 36))
    lengths[rng.random((30, 36)) < 0.7] = np.nan
    lengths[0] = np.nan
    turned = [np.roll(lengths, k, axis=1) for k in range(-aside, aside + 1)]
    expected = np.fmin.reduce(turned)
    np.testing.assert_array_equal(nearest_around(lengths, aside), expected)
    assert np.isnan(expected).any()
