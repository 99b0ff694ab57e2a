"""Looked-up ranges against those that are cast."""

import time

import numpy as np
import pytest

from mcloc.errors import MapError
from mcloc.geometry import compose, inverse
from mcloc.kernels import jit
from mcloc.maps import ray_caster
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.maps.range_table import MOST_STEPS, RangeTable
from mcloc.maps.ray_caster import RayCaster

CELL, SPACING, FAR = 0.1, 0.04, 9.0
ANGLES = 36  # none of them goes through corners from the middle of a cell
STEP = 2.0 * np.pi / ANGLES
BEYOND, NOT_KNOWN = -1.0, -2.0  # what is looked up instead of a range
ORIGINS = [(0.0, 0.0, 0.0), (3.0, -2.0, 0.7), (-40.0, 12.0, -3.1)]
MOUNTS = [(0.0, 0.0, 0.0), (0.25, -0.1, 0.0), (-0.1, 0.05, 2.0)]


def a_map(origin=(0.0, 0.0, 0.0), shape=(14, 19), walls=0.06, unknown=0.03):
    rng = np.random.default_rng(1)
    p = [1.0 - walls - unknown, walls, unknown]
    cells = rng.choice([FREE, OCCUPIED, UNKNOWN], shape, p=p).astype(np.int8)
    return OccupancyGrid(cells, CELL, np.array(origin))


def table_of(grid, angles=ANGLES, spacing=SPACING, memory=1000.0):
    return RangeTable(RayCaster(grid), angles, spacing, memory)


def function_of_range(knots=600):
    """(1, K + 2): the range itself."""
    return np.append(SPACING * np.arange(knots), [BEYOND, NOT_KNOWN]).astype(np.float32)[None]


def looked_up(table, x, mount, angles, range_max=FAR):
    """(n, B): one beam at a time."""
    log_p, first = table.spread(function_of_range(), range_max), np.zeros(1, dtype=np.intp)
    found = [table.sum(x, np.array(mount), [angle], log_p, first) for angle in angles]
    return np.stack(found, axis=-1)


def from_middles(grid, mount, turns):
    """(3, n): poses of the robot with its sensor in the middle of each cell of the map and of two
    rings around it, heading in table directions all around and around again.
    """
    height, width = grid.cells.shape
    row, column = np.indices((height + 4, width + 4)).reshape(2, -1) - 2
    heading = STEP * np.resize(turns, len(row)) - mount[2]
    local = np.stack([(column + 0.5) * CELL, (row + 0.5) * CELL, STEP * np.resize(turns, len(row))])
    sensor = compose(grid.origin, local.T)
    sensor[:, 2] = grid.origin[2] + heading + mount[2]  # not wrapped: −4π … 4π
    x = compose(sensor, inverse(mount)).T
    x[2] = sensor[:, 2] - mount[2]
    return np.ascontiguousarray(x)


def assert_near(found, exactly):
    """Within half a spacing, and what float32 makes of a range."""
    expected = np.where(np.isnan(exactly), NOT_KNOWN, exactly)
    assert np.abs(found - expected).max() <= SPACING / 2.0 + 1e-6


@pytest.mark.parametrize("mount", MOUNTS, ids=str)
@pytest.mark.parametrize("origin", ORIGINS, ids=str)
def test_ranges_from_the_middles_of_cells_are_exact_to_half_a_spacing(origin, mount):
    """From free cells, walls, unknown ones and off the map, in each direction of the table."""
    grid = a_map(origin)
    table, angles = table_of(grid), STEP * np.arange(-20, 21, 5)
    x = from_middles(grid, mount, np.arange(-72, 73))
    exactly = table.caster.ranges(x, np.array(mount), angles, FAR)
    assert_near(looked_up(table, x, mount, angles), exactly)
    assert (exactly == 0.0).sum() > 50
    assert 100 < np.isnan(exactly).sum() < 0.9 * exactly.size


@pytest.mark.parametrize("angles", [4, 7, 180, 1000])
def test_any_number_of_directions(angles):
    """Around the circle in steps, from the first and from the last on, and from ±π."""
    grid = a_map(walls=0.2, shape=(5, 6))
    table, step = table_of(grid, angles), 2.0 * np.pi / angles
    x = np.zeros((3, 30))
    row, column = np.indices((5, 6)).reshape(2, -1)
    x[0], x[1] = (column + 0.5) * CELL, (row + 0.5) * CELL
    turns = np.array([-angles - 1, -angles, -1, 0, 1, angles // 2, angles - 1, angles])
    for heading in (-np.pi, 0.0, np.pi):
        if angles % 2 and heading:
            continue
        x[2] = heading
        exactly = table.caster.ranges(x, np.zeros(3), step * turns, FAR)
        assert_near(looked_up(table, x, np.zeros(3), step * turns), exactly)


@pytest.mark.parametrize("angles", [36, 180, 1000, 10_000])
def test_directions_that_are_rounded_up_to_the_whole_circle_are_those_of_0(angles):
    """Headings and beams a hair below 0, each and together: the direction 0 or the last one, of the
    same cell, also where no other cell comes after it.
    """
    grid = a_map(walls=0.2, shape=(5, 6))
    table, step = table_of(grid, angles), 2.0 * np.pi / angles
    x = from_middles(grid, np.zeros(3), [0])
    last, first = looked_up(table, x, np.zeros(3), [-step, 0.0]).T
    for heading in (0.0, *-(0.5 ** np.arange(8.0, 60.0, 2.0))):
        x[2] = (heading - 0.5) * step
        beams = -(0.5 ** np.arange(5.0, 50.0)) * step
        found = looked_up(table, x, np.zeros(3), beams).T
        assert ((found == first) | (found == last)).all()


@pytest.mark.parametrize("heading", [np.nan, np.inf, -np.inf, 1e300, -1e19])
def test_no_heading_leads_out_of_the_table(heading):
    table, x = table_of(a_map()), from_middles(a_map(), np.zeros(3), [0])
    x[2] = heading * np.linspace(1.0, 2.0, x.shape[1])
    with np.errstate(invalid="ignore", over="ignore"):
        found = looked_up(table, x, MOUNTS[2], [0.0, 1.0])
    assert ((found == NOT_KNOWN) | ((found >= 0.0) & (found <= FAR))).all()
    if not np.isfinite(heading):
        assert (found == NOT_KNOWN).all()


def test_a_ray_begins_in_the_middle_of_its_cell_and_goes_in_the_nearest_direction():
    """Anywhere in a cell, within half a step of a direction, nothing else is looked up."""
    grid = a_map(ORIGINS[1])
    table, rng, mount = table_of(grid), np.random.default_rng(2), np.array([0.0, 0.0, 0.4])
    x = from_middles(grid, mount, np.arange(-40, 41))
    off = rng.uniform(-0.499, 0.499, x.shape) * np.array([[CELL], [CELL], [STEP]])
    moved = compose(np.array([0.0, 0.0, grid.origin[2]]), off.T).T
    moved[2] = off[2]
    angles = STEP * np.arange(-18, 19, 4)
    from_the_middle = looked_up(table, x, mount, angles)
    assert np.array_equal(looked_up(table, x + moved, mount, angles), from_the_middle)
    beside = moved.copy()
    beside[2] = np.where(off[2] > 0.0, 0.501, -0.501) * STEP
    assert (looked_up(table, x + beside, mount, angles) != from_the_middle).mean() > 0.1


@pytest.mark.parametrize("beams", [1, 3, 4, 5, 15, 16, 17, 33, 361])
def test_a_sum_is_over_all_beams_each_with_its_function(beams):
    """Of a f(e) with factors a to choose from: to half a spacing a beam, times the factor."""
    rng = np.random.default_rng(beams)
    grid = a_map(ORIGINS[1])
    table, factors = table_of(grid), np.array([[1.0], [-0.5], [3.0]], dtype=np.float32)
    log_p = table.spread(factors * function_of_range(), FAR)
    which = rng.integers(0, 3, beams)
    angles = STEP * rng.integers(-40, 40, beams)
    x = from_middles(grid, np.zeros(3), np.arange(-40, 41))
    exactly = table.caster.ranges(x, np.zeros(3), angles, FAR)
    factor = factors[which, 0].astype(float)
    expected = (np.where(np.isnan(exactly), NOT_KNOWN, exactly) * factor).sum(axis=1)
    found = table.sum(x, np.zeros(3), angles, log_p, which)
    allowed = np.abs(factor).sum() * (SPACING / 2.0 + 1e-6)
    assert np.abs(found - expected).max() <= allowed
    single = sum(
        table.sum(x, np.zeros(3), angles[b : b + 1], log_p, which[b : b + 1]) for b in range(beams)
    )
    assert found == pytest.approx(single, abs=1e-12 * beams)


@pytest.mark.parametrize("range_max", [0.3, 0.32, 1.0, 100.0])
def test_what_is_out_of_reach_is_told_apart(range_max):
    grid = a_map(walls=0.02, unknown=0.01)
    table, angles = table_of(grid), STEP * np.arange(36)
    x = from_middles(grid, np.zeros(3), [0])
    exactly = table.caster.ranges(x, np.zeros(3), angles, FAR)
    found = looked_up(table, x, np.zeros(3), angles, range_max)
    half = SPACING / 2.0 + 1e-6
    assert np.array_equal(found == NOT_KNOWN, np.isnan(exactly))
    assert (found[exactly > range_max + half] == BEYOND).all()
    near = exactly < range_max - half
    assert np.abs(found - exactly)[near].max() <= half
    between = ~near & (exactly <= range_max + half)
    assert ((found == BEYOND) | (np.abs(found - exactly) <= half))[between].all()


@pytest.mark.parametrize("place", [np.nan, np.inf, -np.inf, 1e300, -1e6])
def test_nothing_is_known_of_no_place(place):
    table = table_of(a_map())
    x = np.array([[place, 0.75, place], [0.75, place, place], [0.3, 0.3, 0.3]])
    with np.errstate(invalid="ignore"):
        assert (looked_up(table, x, np.zeros(3), [0.0, 1.0]) == NOT_KNOWN).all()


def test_nobody_sees_nothing():
    table = table_of(a_map())
    log_p = table.spread(function_of_range(), FAR)
    assert table.sum(np.empty((3, 0)), np.zeros(3), [0.0], log_p, np.zeros(1, int)).shape == (0,)
    blind = table.sum(np.ones((3, 4)), np.zeros(3), [], log_p, np.zeros(0, int))
    assert blind.tolist() == [0.0] * 4


def test_a_table_that_is_too_large_is_refused_before_anything_is_built(monkeypatch):
    """4 million cells × 360 directions × 2 bytes. To cast their rays would take half a minute."""

    def built(*_):
        raise AssertionError("something has been built")

    monkeypatch.setattr(ray_caster, "leaps_of", built)
    monkeypatch.setattr(RayCaster, "from_cells", built)
    grid = OccupancyGrid(np.zeros((2000, 2000), dtype=np.int8), CELL, np.zeros(3), name="hall.yaml")
    begun = time.perf_counter()
    with pytest.raises(MapError) as refused:
        table_of(grid, 360, SPACING, 500.0)
    assert time.perf_counter() - begun < 5.0
    for part in ("hall.yaml", "4000000 cells", "360 directions", "2896 MB", "500 MB"):
        assert part in str(refused.value)
    for remedy in ("sensor.table_memory", "sensor.ranges=exact", "sensor.table_angles"):
        assert remedy in str(refused.value)


def test_the_limit_is_what_the_table_takes():
    """2 bytes a passable cell and direction, with the two rows of what is none; 4 a cell."""
    grid = a_map()
    cells, with_ring = int(grid.free.sum()), 16 * 21
    takes = (2 * (cells + 2) * ANGLES + 4 * with_ring) / 1e6
    row_of, rows = table_of(grid, memory=takes).rows
    assert row_of.nbytes + rows.nbytes == pytest.approx(takes * 1e6)
    with pytest.raises(MapError, match="directions takes"):
        table_of(grid, memory=takes * 0.999)


def test_steps_must_fit_16_bits(monkeypatch):
    assert MOST_STEPS + 1 < 2**16  # one more is held than there are
    grid = a_map()
    diagonal = CELL * np.hypot(14, 19)
    spacing = diagonal / (MOST_STEPS - 1.5)
    x = from_middles(grid, np.zeros(3), [0])
    exactly = table_of(grid).caster.ranges(x, np.zeros(3), [0.0], FAR)[:, 0]
    table = table_of(grid, spacing=spacing)
    function = np.append(spacing * np.arange(MOST_STEPS), [BEYOND, NOT_KNOWN])
    log_p = table.spread(function.astype(np.float32)[None], FAR)
    found = table.sum(x, np.zeros(3), [0.0], log_p, np.zeros(1, dtype=np.intp))
    expected = np.where(np.isnan(exactly), NOT_KNOWN, exactly)
    assert np.abs(found - expected).max() <= spacing / 2.0 + 1e-6
    monkeypatch.setattr(RayCaster, "from_cells", None)  # refused before it is called
    with pytest.raises(MapError, match=r"too far for a table in steps of sensor\.sigma_hit / 4"):
        table_of(grid, spacing=diagonal / (MOST_STEPS - 0.5))


def test_no_number_of_threads_changes_a_bit(monkeypatch):
    monkeypatch.setattr(jit, "SERIAL_BELOW", 0)
    before, grid = jit._threads, a_map(ORIGINS[1])
    rng = np.random.default_rng(3)
    x = np.ascontiguousarray(
        compose(grid.origin, rng.uniform([-0.3, -0.3, -9.0], [2.2, 1.7, 9.0], (701, 3))).T
    )
    angles, found = np.linspace(-2.0, 2.0, 30), []
    try:
        for threads in (1, 2, 5):
            jit.set_threads(threads)
            table = table_of(grid)
            log_p = table.spread(function_of_range(), FAR)
            found.append((table.sum(x, np.zeros(3), angles, log_p, np.zeros(30, int)), table.rows))
    finally:
        jit.set_threads(before)
    for total, rows in found[1:]:
        assert np.array_equal(total, found[0][0])
        assert np.array_equal(rows[1], found[0][1][1])


@pytest.mark.parametrize(("degrees", "aside"), [(20.0, 1), (24.0, 1), (40.0, 2), (180.0, 9)])
@pytest.mark.parametrize("origin", ORIGINS, ids=str)
def test_a_cone_has_the_least_range_of_the_directions_in_it(origin, degrees, aside):
    """Directions 10° apart; the unknown ones count only where there are no others."""
    grid, mount = a_map(origin), np.zeros(3)
    table = RangeTable(RayCaster(grid), ANGLES, SPACING, 1000.0, np.radians(degrees))
    angles, x = STEP * np.arange(-20, 21, 5), from_middles(grid, mount, np.arange(-72, 73))
    fan = STEP * np.arange(-aside, aside + 1)
    rays = [table.caster.ranges(x, mount, angles + off, FAR) for off in fan]
    exactly = np.fmin.reduce(rays)
    assert_near(looked_up(table, x, mount, angles), exactly)
    assert (np.isnan(rays).any(axis=0) & (exactly > 0.0)).sum() > 100
    assert np.isnan(exactly).sum() > 100


def test_a_cone_that_holds_one_direction_is_a_ray():
    grid = a_map()
    narrow = RangeTable(RayCaster(grid), ANGLES, SPACING, 1000.0, 0.9 * STEP)
    assert np.array_equal(narrow.rows[1], table_of(grid).rows[1])
