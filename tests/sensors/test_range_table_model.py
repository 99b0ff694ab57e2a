"""Beam models with looked-up ranges: their equation at the knots, and how near to exact ranges."""

from dataclasses import replace

import numpy as np
import pytest

from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.errors import ConfigError, MapError
from mcloc.events import Scan
from mcloc.geometry import compose
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.sensors import SENSORS
from mcloc.simulation import office_world
from mcloc.simulation.ranges import ranges

BEAMS = [name for name in SENSORS if name.startswith("beam-")]
CELL, REACH, SIGMA = 0.1, 2.5, 0.2
KNOT = SIGMA / 4.0


def room():
    """3 m × 2 m with walls around but for a gap, and a pillar; turned."""
    cells = np.full((20, 30), FREE, dtype=np.int8)
    cells[[0, -1]] = OCCUPIED
    cells[:, [0, -1]] = OCCUPIED
    cells[8:13, 0] = UNKNOWN
    cells[9:12, 15] = OCCUPIED
    return OccupancyGrid(cells, CELL, np.array([2.0, -1.0, 0.6]))


def from_middles(grid, angles):
    """(3, n): poses in the middle of every third cell, heading in each of the directions."""
    row, column, turn = np.meshgrid(np.arange(1, 19, 3), np.arange(1, 29, 3), np.arange(angles))
    local = np.stack([column + 0.5, row + 0.5, turn * 2.0 * np.pi / angles / CELL], axis=-1) * CELL
    return np.ascontiguousarray(compose(grid.origin, local.reshape(-1, 3)).T)


@pytest.mark.parametrize("name", BEAMS)
def test_is_its_equation_between_knots(name):
    """From the middles of cells in directions of the table, both the reading and the expected range
    are held to the nearest knot; nothing else is lost, but for float32, and a factor that is the
    same everywhere.
    """
    angles = 36  # no diagonals: rays through corners may end at either neighbour
    model = SENSORS.make(name, room(), ranges="table", table_angles=angles, sigma_hit=SIGMA)
    x, beams = from_middles(model.grid, angles), 2.0 * np.pi / angles * np.array([-4, 0, 1, 9])
    expected = model.rays.ranges(x, np.zeros(3), beams, np.inf)
    steps = expected / KNOT
    decided = ~(np.abs(steps - np.floor(steps) - 0.5) < 1e-6).any(axis=1)  # rounded either way
    held = np.where(np.isnan(expected), np.nan, KNOT * np.rint(steps))
    held[held >= REACH] = np.inf
    for readings in ([0.5, 1.03, 1.27, 2.48], [0.02, 2.09, REACH, np.inf]):
        total = np.zeros(x.shape[1])
        for reading, e in zip(readings, held.T, strict=True):
            z = np.array(min(KNOT * np.rint(reading / KNOT), REACH - KNOT))
            z = z if reading < REACH else np.array(REACH)
            total += np.log(model.density(z, e, REACH))
        scan = Scan(0.0, np.array(readings), beams, REACH)
        factor = (model.log_likelihood(x, scan) / model.tempering(scan) - total)[decided]
        assert np.ptp(factor) < 1e-5
        assert np.ptp(total[decided]) > 5.0
    assert decided.mean() > 0.5
    assert min(np.isnan(expected).sum(), (expected >= REACH).sum()) > 100


@pytest.mark.parametrize("name", BEAMS)
def test_is_near_to_that_of_exact_ranges(name):
    """All over an office of 5-cm cells and around the true pose. Measured for 4 scans and the three
    models: a correlation of 0.996 or more, 0.06 a beam in the mean; twice of that is allowed.
    """
    world = office_world(2)
    exact, table = (SENSORS.make(name, world, ranges=ranges) for ranges in ("exact", "table"))
    anywhere = FreeSpace(world)
    angles, mount = np.linspace(-2.0, 2.0, 60), np.array([0.1, 0.0, 0.1])
    for seed in range(2):
        rng = np.random.default_rng(seed)
        true = anywhere.sample(Draws(9, seed), 0, 1)
        readings = ranges(world, compose(true.T, mount), angles, 12.0)[0]
        readings += rng.normal(0.0, 0.05, 60)
        z = Scan(0.0, readings, angles, 12.0, mount=mount)
        near = true + rng.normal(0.0, [[0.5], [0.5], [0.2]], (3, 1000))
        for x in (anywhere.sample(Draws(1, seed), 0, 1000), near):
            a, b = exact.log_likelihood(x, z), table.log_likelihood(x, z)
            assert np.corrcoef(a, b)[0, 1] > 0.992
            of_a_beam = (b - a) / exact.tempering(z) / 60.0
            assert np.abs(of_a_beam).mean() < 0.12
            assert abs(of_a_beam.mean()) < 0.03


@pytest.mark.parametrize("name", BEAMS)
def test_a_table_that_is_too_large_is_refused_when_the_model_is_built(name):
    with pytest.raises(MapError, match=r"sensor\.table_memory = 0\.1 MB"):
        SENSORS.make(name, room(), ranges="table", table_memory=0.1)
    SENSORS.make(name, room(), table_memory=0.1)  # no table, no limit
    with pytest.raises(ConfigError, match="ranges must be one of exact, table"):
        SENSORS.make(name, room(), ranges="quick")


def test_scans_of_several_reaches_have_tables_of_their_own():
    model = SENSORS.make("beam-four-part", room(), ranges="table")
    x = from_middles(model.grid, 5)
    short = Scan(0.0, np.array([0.7, 1.1]), np.array([0.0, 0.5]), 1.5)
    long = replace(short, range_max=8.0)
    first = [model.log_likelihood(x, z) for z in (short, long)]
    again = [model.log_likelihood(x, z) for z in (short, long)]
    assert np.array_equal(first, again)
    alone = replace(model).log_likelihood(x, long)
    assert np.array_equal(first[1], alone)
    assert (first[0] != first[1]).any()


def test_the_tables_of_all_readings_are_bounded_too():
    model = SENSORS.make(
        "beam-yee", office_world(1), ranges="table", table_angles=8, sigma_hit=0.02, table_memory=50
    )
    z = Scan(0.0, np.full(3, 2.0), np.zeros(3), 30.0)
    with pytest.raises(MapError, match=r"more than sensor\.table_memory = 50 MB; use"):
        model.log_likelihood(np.ones((3, 2)), z)
