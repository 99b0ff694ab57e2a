"""Expected ranges against the simulator's own ray caster, which is plain NumPy; in
tests/kernels/test_raycast.py against exact arithmetic.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcloc.geometry import compose
from mcloc.kernels import jit
from mcloc.kernels.cones import LARGEST_LEAP, WALL
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.maps.ray_caster import RayCaster
from mcloc.simulation import office_world
from mcloc.simulation.ranges import ranges

CELL = 0.1
DIAGONALS = np.concatenate([np.arange(8) * np.pi / 4.0, np.arctan2([1, 2, -1, -3], [2, 1, 3, -1])])


def random_grid(rng, shape=(9, 12), walls=0.15, unknown=0.1, origin=(0.0, 0.0, 0.0)):
    p = [1.0 - walls - unknown, walls, unknown]
    cells = rng.choice([FREE, OCCUPIED, UNKNOWN], shape, p=p).astype(np.int8)
    return OccupancyGrid(cells, CELL, np.array(origin))


def by_the_simulator(grid, sensor, angles, range_max):
    """(n, B): the range to the first wall; NaN where it lies behind what is not known, inf beyond
    reach. sensor: (n, 3). What is not free, and a ring around the map, stops a ray.
    """
    stops = np.pad(np.where(grid.free, FREE, OCCUPIED).astype(np.int8), 1, constant_values=OCCUPIED)
    corner = compose(grid.origin, [-grid.resolution, -grid.resolution, 0.0])
    around = replace(grid, cells=stops, origin=corner)
    first = ranges(around, sensor, angles, range_max)
    walls = ranges(grid, sensor, angles, range_max)
    found = np.where(walls > first + 1e-12, np.nan, walls)
    row, column = grid.cell_of(sensor)
    height, width = grid.cells.shape
    off = (row < 0) | (row >= height) | (column < 0) | (column >= width)
    return np.where(off[:, None], np.nan, found)


def assert_agree(grid, local, angles, range_max, mount=(0.0, 0.0, 0.0)):
    x = np.ascontiguousarray(compose(grid.origin, local).T)
    found = RayCaster(grid).ranges(x, np.array(mount), angles, range_max)
    expected = by_the_simulator(grid, compose(x.T, mount), angles, range_max)
    assert found == pytest.approx(expected, abs=1e-9, nan_ok=True)


@given(
    seed=st.integers(0, 2**32 - 1),
    walls=st.sampled_from([0.0, 0.02, 0.15, 0.5]),
    unknown=st.sampled_from([0.0, 0.02, 0.2]),
    range_max=st.sampled_from([0.35, 1.0, 5.0]),
)
@settings(max_examples=60, deadline=None)
def test_agrees_with_the_simulator_on_random_maps(seed, walls, unknown, range_max):
    """From anywhere on and off the map, turned and moved, by a sensor that sits off-centre."""
    rng = np.random.default_rng(seed)
    origin = rng.uniform(-20.0, 20.0, 3)
    grid = random_grid(rng, walls=walls, unknown=unknown, origin=origin)
    local = rng.uniform([-0.2, -0.2, -np.pi], [1.4, 1.1, np.pi], (8, 3))
    assert_agree(grid, local, rng.uniform(-np.pi, np.pi, 10), range_max, (0.05, -0.02, 0.3))


def classes(grid, points):
    """(P, 4) of the cells within 1e-6 cells of each of the points (P, 2), given in cells."""
    height, width = grid.cells.shape
    beside = 1e-6 * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    column, row = np.moveaxis(np.floor(points[:, None] + beside).astype(int), -1, 0)
    off = (row < 0) | (row >= height) | (column < 0) | (column >= width)
    inside = grid.cells[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
    return np.where(off, UNKNOWN, inside)


@given(seed=st.integers(0, 2**32 - 1), walls=st.sampled_from([0.02, 0.15, 0.5]))
@settings(max_examples=30, deadline=None)
def test_rays_along_borders_and_through_corners_end_where_they_may(seed, walls):
    """They may meet the cells on either side, or slip between two that touch at a corner: they end
    where they touch what they say, and pass through the inside of free cells alone.
    """
    rng = np.random.default_rng(seed)
    grid = random_grid(rng, walls=walls)
    x = np.zeros((3, 12))
    x[:2] = rng.integers(0, [[24], [18]], (2, 12)) * CELL / 2.0
    found = RayCaster(grid).ranges(x, np.zeros(3), DIAGONALS, 5.0) / CELL
    for place, ends in zip(x.T, found, strict=True):
        for angle, end in zip(DIAGONALS, ends, strict=True):
            assert end != np.inf  # the map is 1.2 m wide
            start, way = place[:2] / CELL, np.array([np.cos(angle), np.sin(angle)])
            borders = [(np.arange(-1, 15) - o) / d for o, d in zip(start, way, strict=True) if d]
            along = np.sort(np.concatenate([*borders, np.arange(0.0, 16.0, 0.037)]))
            along = along[(along >= 0.0) & (along < 20.0)]
            met = classes(grid, start + along[:, None] * way)
            blocked = (met != FREE).all(axis=1)
            if np.isnan(end):
                assert (met[: blocked.argmax() + 1] == UNKNOWN).any()
            else:
                assert (classes(grid, (start + end * way)[None]) == OCCUPIED).any()
                assert not blocked[along < end - 1e-6].any()


def test_agrees_with_the_simulator_on_a_floor_of_offices():
    world = office_world(3)
    rng = np.random.default_rng(4)
    local = rng.uniform([0.6, 0.6, -np.pi], [20.4, 15.4, np.pi], (100, 3))
    assert_agree(world, local, np.linspace(-2.0, 2.0, 41), 10.0)


@pytest.mark.parametrize("beams", [1, 255, 256, 257, 600])
def test_agrees_with_the_simulator_whatever_the_number_of_beams(beams):
    """Rays are cast 256 at a time: from the middle of a scan on, and of poses on and off the map
    together.
    """
    rng = np.random.default_rng(beams)
    grid = random_grid(rng, (40, 50), walls=0.03, unknown=0.01, origin=(-3.0, 8.0, 2.2))
    local = rng.uniform([-1.0, -1.0, -np.pi], [6.0, 5.0, np.pi], (30, 3))
    angles = np.linspace(-np.pi, np.pi, beams, endpoint=False)
    assert_agree(grid, local, angles, 2.5, (0.1, 0.03, -0.4))


def test_nobody_sees_nothing():
    caster, table = RayCaster(one_room()), np.ones((3, 200), dtype=np.float32)
    x, angles = np.empty((3, 0)), [-0.1, 0.0, 0.1]
    assert caster.ranges(x, np.zeros(3), angles, 9.0).shape == (0, 3)
    assert caster.sum(x, np.zeros(3), angles, 9.0, table, 0.05).shape == (0,)
    blind = caster.sum(np.ones((3, 4)), np.zeros(3), [], 9.0, table[:0], 0.05)
    assert blind.tolist() == [0.0] * 4


def test_leaps_change_nothing():
    """The same ranges, to rounding, as from cell to cell."""
    world = office_world(3)
    rng = np.random.default_rng(5)
    x = rng.uniform([0.0, 0.0, -np.pi], [20.0, 15.0, np.pi], (300, 3)).T.copy()
    leaping, stepping = RayCaster(world), RayCaster(world)
    leaps = leaping._leaps
    ones = np.where((leaps > WALL) & (leaps <= LARGEST_LEAP), 1, leaps).astype(np.uint8)
    object.__setattr__(stepping, "_leaps", ones)
    assert np.unique(leaps).size > 100
    angles = np.linspace(-np.pi, np.pi, 37)
    a, b = (c.ranges(x, np.zeros(3), angles, 30.0) for c in (leaping, stepping))
    assert np.isfinite(a).sum() > 1000
    assert a == pytest.approx(b, abs=1e-9, nan_ok=True)


def one_room():
    """3 m × 3 m of free space with walls around, and 0.5 m that nobody has seen around these."""
    cells = np.full((42, 42), UNKNOWN, dtype=np.int8)
    cells[5:-5, 5:-5] = OCCUPIED
    cells[6:-6, 6:-6] = FREE
    return OccupancyGrid(cells, CELL, np.zeros(3))


@pytest.mark.parametrize(
    "place", [(0.55, 2.0), (2.0, 3.65), (3.6999, 3.6999)], ids=["left", "top", "corner"]
)
def test_a_sensor_in_a_wall_measures_0(place):
    x = np.array([[place[0]], [place[1]], [0.4]])
    assert RayCaster(one_room()).ranges(x, np.zeros(3), DIAGONALS, 9.0).tolist() == [[0.0] * 12]


@pytest.mark.parametrize(
    "place",
    [(0.2, 2.0), (-0.1, 2.0), (2.0, -500.0), (1e300, 2.0), (np.inf, 2.0), (np.nan, 2.0)],
    ids=str,
)
def test_nothing_is_expected_from_where_nothing_is_known(place):
    x = np.array([[place[0]], [place[1]], [0.0]])
    with np.errstate(invalid="ignore"):
        found = RayCaster(one_room()).ranges(x, np.zeros(3), DIAGONALS, 9.0)
    assert np.isnan(found).all()


@pytest.mark.parametrize("heading", [np.nan, np.inf, -np.inf, 1e300, -1e19])
def test_nothing_is_expected_from_no_heading(heading):
    x = np.array([[2.0, 2.0], [2.0, 2.0], [heading, 0.0]])
    with np.errstate(invalid="ignore", over="ignore"):
        found = RayCaster(one_room()).ranges(x, np.zeros(3), DIAGONALS, 9.0)
    assert np.isnan(found[0]).all()
    assert np.isfinite(found[1]).all()


def test_a_wall_at_range_max_is_not_within_reach():
    x = np.array([[2.0], [2.0], [0.0]])
    for reach, expected in ((1.6, np.inf), (1.6001, 1.6)):
        found = RayCaster(one_room()).ranges(x, np.zeros(3), [0.0], reach)
        assert found[0, 0] == pytest.approx(expected)


def test_undecided_cells_in_front_of_a_wall_are_its_blurred_face():
    cells = np.full((5, 30), FREE, dtype=np.int8)
    cells[:, 18:20], cells[:, 20] = UNKNOWN, OCCUPIED
    cells[0, 10], cells[1, 10:] = UNKNOWN, UNKNOWN
    grid = OccupancyGrid(cells, CELL, np.zeros(3))
    x = np.array([[0.05] * 3, [0.25, 0.05, 0.15], [0.0] * 3])

    def ahead(blur):
        return RayCaster(grid, blur).ranges(x, np.zeros(3), [0.0], 9.0)[:, 0]

    assert np.isnan(ahead(0.0)).all()
    assert np.isnan(ahead(0.11)).all()  # one of the two cells
    # The second ray meets an unknown cell far from walls, the third a strip of them.
    assert ahead(0.2001) == pytest.approx([1.95, np.nan, np.nan], nan_ok=True)


def test_the_sum_is_that_of_a_table_over_the_ranges():
    """Linear between the knots, by NumPy; `beyond` and `unknown` have columns of their own."""
    rng = np.random.default_rng(6)
    grid = random_grid(rng, (60, 80), walls=0.01, unknown=0.005, origin=(3.0, -2.0, 0.7))
    local = rng.uniform([0.0, 0.0, -np.pi], [8.0, 6.0, np.pi], (50, 3))
    x = np.ascontiguousarray(compose(grid.origin, local).T)
    angles, reach, spacing = np.linspace(-1.5, 1.5, 13), 3.0, 0.07
    caster, mount = RayCaster(grid), np.array([0.2, 0.0, 0.1])
    knots = spacing * np.arange(2 + int(caster.farthest(reach) / spacing))
    table = rng.normal(size=(13, len(knots) + 2)).astype(np.float32)
    expected = caster.ranges(x, mount, angles, reach)
    assert np.isinf(expected).any()
    assert np.isnan(expected).any()
    total = np.zeros(50)
    for b in range(13):
        between = np.interp(np.nan_to_num(expected[:, b], posinf=0.0), knots, table[b, :-2])
        ended = np.where(np.isinf(expected[:, b]), table[b, -2], between)
        total += np.where(np.isnan(expected[:, b]), table[b, -1], ended)
    assert caster.sum(x, mount, angles, reach, table, spacing) == pytest.approx(total, abs=1e-5)


@pytest.mark.parametrize("beams", [1, 7, 300])
def test_no_number_of_threads_changes_a_bit(monkeypatch, beams):
    monkeypatch.setattr(jit, "SERIAL_BELOW", 0)
    world, before = office_world(1), jit._threads
    x = np.random.default_rng(7).uniform([-1, -1, -3], [21, 16, 3], (101, 3)).T.copy()
    angles = np.linspace(-1.5, 1.5, beams)
    table = np.ones((beams, 500), dtype=np.float32).cumsum(axis=1)
    found = []
    try:
        for threads in (1, 3):
            jit.set_threads(threads)
            caster = RayCaster(world)
            found.append(
                (
                    caster.ranges(x, np.zeros(3), angles, 10.0),
                    caster.sum(x, np.zeros(3), angles, 10.0, table, 0.05),
                )
            )
    finally:
        jit.set_threads(before)
    for one, three in zip(*found, strict=True):
        assert np.array_equal(one, three, equal_nan=True)


def test_no_beams_have_no_ranges():
    found = RayCaster(one_room()).ranges(np.ones((3, 4)), np.zeros(3), [], 9.0)
    assert found.shape == (4, 0)
