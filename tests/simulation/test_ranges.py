"""The simulated range finder against geometry worked out by other means."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mcloc.geometry import compose
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.simulation import office_world, ranges
from mcloc.simulation.ranges import first_walls, rays

RESOLUTION = 0.1
WIDTH, HEIGHT = 4.0, 3.0  # m, between the walls of the room


def room(origin: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> OccupancyGrid:
    """Walls one cell thick; the grid frame's (0.1, 0.1) is the lower left inner corner."""
    cells = np.full((32, 42), OCCUPIED, dtype=np.int8)
    cells[1:-1, 1:-1] = FREE
    return OccupancyGrid(cells, RESOLUTION, np.array(origin))


def to_box(x: float, y: float, angle: float) -> float:
    """Distance from a place inside a box with the corner (0, 0), by its four lines."""
    cos, sin = np.cos(angle), np.sin(angle)
    with np.errstate(over="ignore"):  # along an axis but for less than 1e-300 rad
        return min(
            (WIDTH - x) / cos if cos > 0 else np.inf,
            -x / cos if cos < 0 else np.inf,
            (HEIGHT - y) / sin if sin > 0 else np.inf,
            -y / sin if sin < 0 else np.inf,
        )


@given(
    x=st.floats(0.01, WIDTH - 0.01),
    y=st.floats(0.01, HEIGHT - 0.01),
    theta=st.floats(-np.pi, np.pi),
    angle=st.floats(-np.pi, np.pi),
    origin=st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-np.pi, np.pi)),
)
@example(x=1.0, y=1.0, theta=0.0, angle=2e-309, origin=(0.0, 0.0, 0.0))
def test_a_box_is_as_far_as_its_walls_wherever_the_map_lies(
    x: float, y: float, theta: float, angle: float, origin: tuple[float, float, float]
) -> None:
    sensor = compose(origin, [x + RESOLUTION, y + RESOLUTION, theta])
    (measured,) = ranges(room(origin), [sensor], [angle], 20.0)[0]
    assert measured == pytest.approx(to_box(x, y, theta + angle), abs=1e-9)


def test_agrees_with_walking_along_each_beam_in_small_steps() -> None:
    world = office_world(5)
    rng = np.random.default_rng(0)
    n, reach, step = 200, 6.0, 0.002  # rays, m, m
    places = np.argwhere(world.free)
    places = (places[rng.integers(len(places), size=n)][:, ::-1] + rng.random((n, 2))) * 0.05
    poses = np.column_stack([places + world.origin[:2], rng.uniform(-np.pi, np.pi, n)])

    distance = np.arange(0.0, reach, step)
    walk = np.zeros((n, len(distance), 3))
    walk[..., 0] = poses[:, :1] + np.cos(poses[:, 2:]) * distance
    walk[..., 1] = poses[:, 1:2] + np.sin(poses[:, 2:]) * distance
    height, width = world.cells.shape
    row, column = world.cell_of(walk)
    inside = world.occupied[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
    walked = np.where(inside.any(axis=1), distance[inside.argmax(axis=1)], np.inf)

    measured = ranges(world, poses, [0.0], reach)[:, 0]
    assert np.isfinite(measured).mean() > 0.8
    # Where a beam clips a corner by less than a step, the walk misses the wall.
    agree = (measured == walked) | (np.abs(measured - np.minimum(walked, 99.0)) <= step)
    assert agree.mean() > 0.98
    assert (measured <= walked + 1e-9).all()


def test_no_return_is_inf_from_range_max_on() -> None:
    sensor = [[RESOLUTION + 1.0, RESOLUTION + 1.0, 0.0]]
    assert ranges(room(), sensor, [0.0], 3.0)[0, 0] == np.inf
    assert ranges(room(), sensor, [0.0], 3.01)[0, 0] == pytest.approx(3.0)


def test_unknown_cells_and_the_outside_let_beams_through() -> None:
    cells = np.full((10, 30), UNKNOWN, dtype=np.int8)
    cells[:, 20] = OCCUPIED
    grid = OccupancyGrid(cells, RESOLUTION, np.zeros(3))
    from_outside = ranges(grid, [[-1.0, 0.55, 0.0]], [0.0, np.pi / 2, np.pi], 10.0)
    np.testing.assert_allclose(from_outside, [[3.0, np.inf, np.inf]])


def test_a_sensor_inside_a_wall_measures_nothing_but_zero() -> None:
    np.testing.assert_array_equal(ranges(room(), [[0.05, 0.05, 0.3]], [0.0, 1.0], 5.0), [[0, 0]])


def test_the_wall_that_is_hit_and_which_way_it_faces() -> None:
    grid = room()
    start, direction = rays(grid, [[1.05, 2.05, 0.0]], np.radians([0.0, 90.0, 180.0, -90.0, 50.0]))
    hits = first_walls(grid.occupied, RESOLUTION, start, direction, 20.0)
    assert hits.cell.T.tolist()[:4] == [[41, 20], [10, 31], [0, 20], [10, 0]]
    assert hits.axis.tolist() == [0, 1, 0, 1, 1]
    end = start + hits.length * direction
    np.testing.assert_allclose(end[1, 4], RESOLUTION + HEIGHT)


@given(seed=st.integers(0, 10_000))
def test_leaps_over_what_is_empty_miss_nothing(seed: int) -> None:
    """Against a walk through every cell, on scattered walls and from outside too."""
    rng = np.random.default_rng(seed)
    cells = np.where(rng.random((30, 40)) < 0.02, OCCUPIED, FREE).astype(np.int8)
    grid = OccupancyGrid(cells, 1.0, np.zeros(3))
    poses = rng.uniform((-5, -5, -np.pi), (45, 35, np.pi), (20, 3))
    found = ranges(grid, poses, [0.0], 60.0)[:, 0]
    for pose, length in zip(poses, found, strict=True):
        heading = np.array([np.cos(pose[2]), np.sin(pose[2])])
        borders = [(np.arange(-9, 50) - pose[k]) / heading[k] for k in (0, 1)]
        crossed = np.sort(np.concatenate([[0.0], *borders]))
        crossed = crossed[crossed >= 0.0]
        middles = pose[:2] + (crossed[:-1] + crossed[1:])[:, None] / 2 * heading
        column, row = np.floor(middles).astype(int).T
        within = (column >= 0) & (column < 40) & (row >= 0) & (row < 30)
        solid = within & grid.occupied[np.clip(row, 0, 29), np.clip(column, 0, 39)]
        # A cell of which a beam cuts a corner by less than rounding may be missed by either.
        solid &= np.diff(crossed) > 1e-9
        expected = crossed[solid.argmax()] if solid.any() else np.inf
        assert length == pytest.approx(expected if expected < 60.0 else np.inf, abs=1e-6)
