"""Squared distances to walls against SciPy's, bit by bit."""

import os

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from mcloc.errors import MapError
from mcloc.kernels import jit
from mcloc.kernels.distance import NO_WALL, columns, envelope_rows, squared_distance

SHAPES = [(1, 1), (1, 40), (40, 1), (2, 2), (3, 50), (50, 3), (23, 31), (40, 40)]


def by_scipy(walls):
    """(H, W) int64; NO_WALL without any wall."""
    if not walls.any():
        return np.full(walls.shape, NO_WALL)
    return np.rint(distance_transform_edt(~walls) ** 2).astype(np.int64)


def random_maps(shape, seeds=8):
    """Maps without walls, of few, of many and of nothing but walls."""
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        for density in (0.0, 0.002, 0.02, 0.1, 0.5, 0.98, 1.0):
            yield rng.random(shape) < density


@pytest.mark.parametrize("shape", SHAPES)
def test_is_that_of_scipy(shape):
    for walls in random_maps(shape):
        result = squared_distance(walls)
        assert result.dtype == np.int32
        assert np.array_equal(result, by_scipy(walls))


@pytest.mark.parametrize("corner", [(0, 0), (0, -1), (-1, 0), (-1, -1)])
def test_one_wall_in_a_corner(corner):
    walls = np.zeros((33, 47), dtype=bool)
    walls[corner] = True
    assert np.array_equal(squared_distance(walls), by_scipy(walls))


def test_lines_at_all_angles_and_circles():
    """Many cells are as near to one wall as to another."""
    y, x = np.mgrid[-20:21, -20:21]
    for angle in np.linspace(0.0, np.pi, 13):
        walls = np.abs(x * np.sin(angle) - y * np.cos(angle)) < 0.5
        assert np.array_equal(squared_distance(walls), by_scipy(walls))
    for radius in (5.0, 12.0, 18.5, 25.0):
        walls = np.abs(np.hypot(x, y) - radius) < 0.6
        assert np.array_equal(squared_distance(walls), by_scipy(walls))


def read_only(walls):
    walls = walls.copy()
    walls.flags.writeable = False
    return walls


@pytest.mark.parametrize(
    "view",
    [
        np.asfortranarray,
        read_only,
        lambda walls: np.repeat(walls, 2, axis=1)[:, ::2],
        lambda walls: walls[::-1, ::-1].copy()[::-1, ::-1],
        lambda walls: walls.astype(np.uint8),
        lambda walls: 100 * walls.astype(np.int64),
        lambda walls: 0.25 * walls,
        lambda walls: walls.tolist(),
    ],
)
def test_takes_any_kind_of_array_and_leaves_it_as_it_was(view):
    walls = np.random.default_rng(1).random((23, 31)) < 0.05
    given = view(walls)
    before = np.array(given)
    assert np.array_equal(squared_distance(given), by_scipy(walls))
    assert np.array_equal(given, before)
    assert len(getattr(columns, "signatures", ())) <= 1


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (23, 31)])
def test_does_not_depend_on_threads(set_threads, monkeypatch, shape):
    monkeypatch.setattr(jit, "SERIAL_BELOW", 0)
    walls = np.random.default_rng(2).random(shape) < 0.04
    walls[0, 0] = True
    results = []
    for threads in (1, 2, 3, 7):
        set_threads(threads)
        results.append(squared_distance(walls))
    assert all(np.array_equal(results[0], result) for result in results[1:])


def test_any_split_gives_the_same_bits():
    walls = (np.random.default_rng(3).random((30, 30)) < 0.05).view(np.uint8)
    half = 0.5 / np.maximum(np.arange(31), 1)
    for split in ([(0, 30)], [(12, 30), (0, 1), (1, 12)]):
        distance = np.empty((30, 30), np.int32)
        for start, stop in split:
            columns(walls, distance, start, stop)
        for start, stop in split:
            envelope_rows(distance, half, start, stop)
        assert np.array_equal(distance, by_scipy(walls.view(bool)))


@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="a million cells as plain Python")
@pytest.mark.parametrize("shape", [(46_000, 20), (20, 46_000), (1, 46_339), (1000, 1300)])
def test_far_walls(shape):
    """Distances of up to 46,000 cells, whose squares just fit."""
    for count in (1, 3, 100):
        rng = np.random.default_rng(count)
        walls = np.zeros(shape, dtype=bool)
        walls[rng.integers(0, shape[0], count), rng.integers(0, shape[1], count)] = True
        walls[-1, -1] = True
        assert np.array_equal(squared_distance(walls), by_scipy(walls))


@pytest.mark.parametrize("shape", [(1, 46_340), (33_000, 33_000)])
def test_a_map_too_large_for_the_squares_raises(shape):
    with pytest.raises(MapError, match=f"got {shape[0]} × {shape[1]}"):
        squared_distance(np.broadcast_to(True, shape))
