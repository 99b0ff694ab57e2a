"""Boxes of poses fill a map without overlapping, at every level."""

import numpy as np
import pytest

from mcloc.geometry import between, wrap
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.samplers.pose_boxes import PARTS, PoseBoxes


@pytest.fixture(params=[1, 3, 8])
def boxes(request):
    """Of a turned map whose sides are no multiples of the squares'."""
    cells = np.random.default_rng(1).choice([FREE, OCCUPIED, UNKNOWN], (31, 44), p=[0.3, 0.4, 0.3])
    grid = OccupancyGrid(cells.astype(np.int8), 0.1, np.array([5.0, -3.0, 2.8]))
    return PoseBoxes(grid, request.param, 20)


def anywhere(boxes, n=5000, seed=2):
    """Poses on the map."""
    height, width = np.array(boxes.grid.cells.shape) * boxes.grid.resolution
    x, y, theta = np.random.default_rng(seed).random((3, n))
    local = np.stack([x * width, y * height, np.pi * (1.0 - 2.0 * theta)])
    cos, sin = np.cos(boxes.grid.origin[2]), np.sin(boxes.grid.origin[2])
    turned = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ local
    moved = turned + boxes.grid.origin[:, None]
    moved[2] = wrap(moved[2])
    return moved


@pytest.mark.parametrize("level", [0, 1, 2])
def test_a_pose_lies_in_the_box_around_it(boxes, level):
    x = anywhere(boxes)
    keys = boxes.around(x, level)
    assert (keys >= 0).all()
    middle = boxes.poses(keys, level, np.full(x.shape, 0.5))
    apart = boxes.grid.to_grid(x.T).T - boxes.grid.to_grid(middle.T).T
    apart[2] = wrap(apart[2])
    assert (np.abs(apart) <= 0.5 * boxes.sides(level)[:, None] + 1e-9).all()


@pytest.mark.parametrize("level", [0, 1, 2])
def test_a_pose_of_a_box_is_found_in_it(boxes, level):
    keys = np.unique(boxes.around(anywhere(boxes), level))
    u = np.random.default_rng(3).uniform(1e-6, 1.0 - 1e-6, (3, len(keys)))
    assert np.array_equal(boxes.around(boxes.poses(keys, level, u), level), keys)


@pytest.mark.parametrize("level", [0, 1])
def test_parts_share_a_box_among_them(boxes, level):
    x = anywhere(boxes)
    whole, part = boxes.around(x, level), boxes.around(x, level + 1)
    parts = boxes.parts(np.unique(whole), level)
    assert len(np.unique(parts)) == len(parts) == PARTS * len(np.unique(whole))
    assert (np.diff(parts) > 0).all()
    assert all(part[k] in boxes.parts(whole[k : k + 1], level) for k in range(200))
    ratio = boxes.sides(level).prod() / boxes.sides(level + 1).prod()
    assert ratio == pytest.approx(PARTS)


def test_off_the_map_there_is_no_box(boxes):
    x = anywhere(boxes, 100)
    x[:2] += 50.0
    assert (boxes.around(x, 1) == -1).all()


def test_the_first_part_of_the_circle_lies_around_the_maps_own_x_axis(boxes):
    step = boxes.sides(0)[2]
    at = boxes.poses(np.zeros(3, dtype=np.int64), 0, np.array([[0.5] * 3, [0.5] * 3, [0, 0.5, 1]]))
    apart = between(boxes.grid.origin, at.T)[:, 2]
    assert apart == pytest.approx([-0.5 * step, 0.0, 0.5 * step])


def test_free_squares_are_those_with_a_free_cell_and_stand_on_it(boxes):
    squares, x = boxes.free_squares()
    assert len(squares) == boxes.count_free_squares()
    row, column = boxes.grid.cell_of(x.T)
    assert boxes.grid.free[row, column].all()
    assert np.array_equal(boxes.around(x, 0), squares * boxes.headings)
    rows, columns = np.nonzero(boxes.grid.free)
    per_row = -(-boxes.grid.cells.shape[1] // boxes.cells)
    expected = np.unique(rows // boxes.cells * per_row + columns // boxes.cells)
    assert np.array_equal(squares, expected)


@pytest.mark.parametrize("level", [1, 2])
def test_the_parent_of_a_box_is_the_one_that_it_is_a_part_of(boxes, level):
    x = anywhere(boxes)
    keys = boxes.around(x, level)
    assert np.array_equal(boxes.parents(keys, level), boxes.around(x, level - 1))
    above = np.unique(boxes.around(x, level - 1))
    parts = boxes.parts(above, level - 1)
    assert np.array_equal(np.unique(boxes.parents(parts, level)), above)
    assert np.array_equal(np.bincount(np.searchsorted(above, boxes.parents(parts, level))),
                          np.full(len(above), PARTS))  # fmt: skip


def test_free_boxes_are_all_headings_of_free_squares(boxes):
    squares, x = boxes.free_squares()
    keys = boxes.free_keys()
    assert (np.diff(keys) > 0).all()
    assert len(keys) == boxes.headings * len(squares)
    for heading in np.linspace(0.0, 6.2, 5):
        turned = x.copy()
        turned[2] = wrap(x[2] + heading)
        assert np.isin(boxes.around(turned, 0), keys).all()
