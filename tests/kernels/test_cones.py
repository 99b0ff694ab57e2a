"""Leaps against what the cones of rays hold, cell by cell; and against rays themselves."""

from fractions import Fraction

import numpy as np
import pytest

from mcloc.kernels.cones import (
    BESIDE_UNKNOWN,
    BESIDE_WALL,
    LARGEST_LEAP,
    PASSABLE,
    SOLID,
    UNKNOWN,
    UNSEEN,
    WALL,
    leaps_of,
)

SHAPES = [(1, 1), (1, 9), (9, 1), (2, 2), (5, 8), (12, 7)]


def ringed(stops):
    return np.pad(stops.astype(np.uint8), 1, constant_values=UNSEEN)


def random_stops(shape, seed):
    """Maps of nothing but free cells, with a few stops, and with many."""
    rng = np.random.default_rng(seed)
    free = (1.0, 0.97, 0.85, 0.4)[seed % 4]
    p = [free, (1.0 - free) / 2.0, (1.0 - free) / 2.0]
    return ringed(rng.choice([PASSABLE, SOLID, UNSEEN], shape, p=p))


def in_the_octant(stops, octant):
    """cell(k, r): what a cell is, by its place along the axes that rays of the octant go along;
    and how many there are along each.
    """
    height, width = stops.shape
    down, left, steep = octant & 4, octant & 2, octant & 1

    def cell(k, r):
        y, x = (k, r) if steep else (r, k)
        return stops[height - 1 - y if down else y, width - 1 - x if left else x]

    return cell, *((height, width) if steep else (width, height))


def leap_by_the_cone(cell, k, r, columns, rows):
    """The columns j = 0, 1 … whose rows r … r + j + 1 are passable, up to the first that is not
    so; or what ends a ray.
    """
    ends = {SOLID: (WALL, BESIDE_WALL), UNSEEN: (UNKNOWN, BESIDE_UNKNOWN)}
    if cell(k, r) != PASSABLE:
        return ends[cell(k, r)][0]
    if cell(k, r + 1) != PASSABLE:
        return ends[cell(k, r + 1)][1]
    for j in range(columns - k):
        for row in range(r, r + j + 2):
            if row >= rows or cell(k + j, row) != PASSABLE:
                return min(j, LARGEST_LEAP)
    raise AssertionError("the ring has no gap")


@pytest.mark.parametrize("octant", range(8))
@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_leaps_are_the_cones(shape, octant):
    for seed in range(8):
        stops = random_stops(shape, seed)
        cell, columns, rows = in_the_octant(stops, octant)
        found = leaps_of(stops).reshape(8, columns, rows)[octant]
        expected = [
            [leap_by_the_cone(cell, k, r, columns, rows) for r in range(rows)]
            for k in range(columns)
        ]
        assert found.tolist() == expected


@pytest.mark.parametrize("octant", range(8))
def test_no_ray_meets_anything_within_a_leap_and_some_ray_does_behind(octant):
    """Rays of 17 slopes from next to the corners of the cell, which leave no row of a cone out,
    followed through each column by exact arithmetic.
    """
    stops = random_stops((10, 13), 5 + octant % 2)
    cell, columns, rows = in_the_octant(stops, octant)
    leaps = leaps_of(stops).reshape(8, columns, rows)[octant]
    tiny = Fraction(1, 10**6)
    within = [tiny, 1 - tiny]
    rays = [(a, b, Fraction(s, 16)) for a in within for b in within for s in range(17)]
    judged = 0
    for k, r in np.argwhere((leaps > WALL) & (leaps <= LARGEST_LEAP)).tolist():
        leap, behind = int(leaps[k, r]), False
        for a, b, slope in rays:
            for j in range(leap + 1):
                low = r + b + slope * max(j - a, 0)  # where the ray enters the column and leaves
                high = r + b + slope * (j + 1 - a)
                met = range(int(low), -int(-high // 1))
                blocked = any(cell(k + j, row) != PASSABLE for row in met)
                assert not (blocked and j < leap)
                behind |= blocked and j == leap
        assert behind
        judged += 1
    assert judged > 20


def test_stops_are_told_apart():
    """Of the octant of rays that go right and up a little, by hand."""
    stops = ringed(np.array([[PASSABLE] * 4, [SOLID, PASSABLE, UNSEEN, PASSABLE]]))
    leaps = leaps_of(stops).reshape(8, 6, 4)[0].T  # as the map: row by row
    assert leaps[1].tolist() == [UNKNOWN, BESIDE_WALL, 1, BESIDE_UNKNOWN, 1, UNKNOWN]
    assert leaps[2].tolist() == [UNKNOWN, WALL, BESIDE_UNKNOWN, UNKNOWN, BESIDE_UNKNOWN, UNKNOWN]
    assert (leaps[[0, 3]] == UNKNOWN).all()


def test_an_empty_map_larger_than_the_largest_leap():
    """Its cones end at its ring, or where leaps are counted no farther."""
    stops = ringed(np.full((290, 275), PASSABLE))
    leaps = leaps_of(stops).reshape(8, stops.size)
    for octant in range(8):
        shape = stops.shape if octant & 1 else stops.shape[::-1]
        k, r = np.indices(shape)
        expected = np.minimum(shape[0] - 1 - k, shape[1] - 2 - r)
        expected = np.minimum(expected, LARGEST_LEAP)
        expected[expected == 0] = BESIDE_UNKNOWN
        ring = (k == 0) | (r == 0) | (k == shape[0] - 1) | (r == shape[1] - 1)
        expected[ring] = UNKNOWN
        assert np.array_equal(leaps[octant].reshape(shape), expected)
        assert (expected == LARGEST_LEAP).sum() > 100


def test_codes_are_no_leaps():
    codes = {WALL, UNKNOWN, BESIDE_WALL, BESIDE_UNKNOWN}
    assert len(codes) == 4
    assert codes.isdisjoint(range(1, LARGEST_LEAP + 1))
    assert codes | set(range(1, LARGEST_LEAP + 1)) == set(range(256))
