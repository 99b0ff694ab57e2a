"""The sum over endpoints against plain NumPy in double precision."""

import numpy as np
import pytest

from mcloc.geometry import compose
from mcloc.kernels.field import FOUR, room_for, sum_over_points
from mcloc.maps.cell_table import CellTable
from mcloc.maps.occupancy import OccupancyGrid

SHAPE = 23, 31
CELL = 0.07


def expected_sum(grid, values, x, points):
    """Σ values[cell], off the map that of the ring; and how near to a border any point came."""
    total, margin = np.zeros(x.shape[1]), np.inf
    for i, pose in enumerate(x.T):
        for point in points:
            local = grid.to_grid(compose(pose, [*point, 0.0]))[:2] / grid.resolution
            margin = min(margin, np.abs(local - np.round(local)).min())
            column, row = np.clip(np.floor(local).astype(int) + 1, 0, [SHAPE[1] + 1, SHAPE[0] + 1])
            total[i] += values[row, column]
    return total, margin


@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (-3.0, 5.0, 0.7), (120.0, -80.0, -2.9)])
def test_sums_the_cells_that_the_points_lie_in(origin):
    rng = np.random.default_rng(2)
    grid = OccupancyGrid(np.zeros(SHAPE, dtype=np.int8), CELL, np.array(origin))
    values = rng.normal(size=(SHAPE[0] + 2, SHAPE[1] + 2)).astype(np.float32)
    local = np.stack(
        [rng.uniform(-0.3, 2.5, 25), rng.uniform(-0.3, 1.9, 25), rng.uniform(-np.pi, np.pi, 25)],
        axis=-1,
    )
    x = np.ascontiguousarray(compose(origin, local).T)
    points = rng.uniform(-1.5, 1.5, (12, 2))  # many lie off the map
    expected, margin = expected_sum(grid, values, x, points)
    # The kernel works in float32: 2⁻²⁴ of at most 100 cells. No point is that near to a border.
    assert margin > 1e-5
    which = np.arange(values.size, dtype=np.int32).reshape(values.shape)
    table = CellTable.chosen(grid, values.ravel().astype(float), which)
    found = table.summed(points)(x)
    assert np.abs(found - expected).max() <= len(points) * table.step / 2.0 + 1e-12


def test_no_points_sum_to_nothing():
    grid = OccupancyGrid(np.zeros(SHAPE, dtype=np.int8), CELL, np.zeros(3))
    which = np.zeros((SHAPE[0] + 2, SHAPE[1] + 2), dtype=np.int32)
    table = CellTable.chosen(grid, np.array([3.0]), which)
    assert table.summed(np.empty((0, 2)))(np.zeros((3, 4))).tolist() == [0.0] * 4


@pytest.mark.parametrize("beams", [1, 3, 4, 30, 33])
def test_any_split_gives_the_same_bits(beams):
    rng = np.random.default_rng(3)
    x = rng.uniform(0.0, 1.0, (3, 50))
    points = rng.uniform(-5.0, 5.0, (2, 48)).astype(np.float32)
    table = rng.integers(0, 65536, 100).astype(np.uint16)
    frame = (10, 10, -0.1, -0.1, np.cos(0.2), np.sin(0.2), 10.0)
    whole, split = np.empty(50), np.empty(50)
    sum_over_points(x, points, beams, table, frame, FOUR, *room_for(48), whole, 0, 50)
    for start, stop in ((0, 1), (1, 30), (30, 50)):
        sum_over_points(x, points, beams, table, frame, FOUR, *room_for(48), split, start, stop)
    assert np.array_equal(whole, split)
