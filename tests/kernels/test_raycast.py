"""Rays against a traversal of the cells in exact arithmetic."""

import os
from fractions import Fraction
from math import floor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from mcloc.kernels.cones import LARGEST_LEAP, PASSABLE, SOLID, UNSEEN, leaps_of
from mcloc.kernels.field import FOUR
from mcloc.kernels.raycast import _LANES, lengths, sum_over_rays

AS_PYTHON = "NUMBA_DISABLE_JIT" in os.environ
BEYOND = Fraction(10**9)


def ringed(stops):
    return np.pad(np.asarray(stops, dtype=np.uint8), 1, constant_values=UNSEEN)


def cast(stops, starts, ways, limit=np.inf, parts=None):
    """(n, B): lengths of rays from starts (n, 2), in cells from the corner of the map's ring, along
    each of the ways (B, 2), as multiples of the way.
    """
    starts, ways = np.reshape(starts, (-1, 2)), np.reshape(ways, (-1, 2))
    x = np.zeros((3, len(starts)))
    x[:2] = starts.T
    out = np.full(len(starts) * len(ways), -7.0)
    across = np.ascontiguousarray(ways.T, dtype=np.float64)
    frame = (*stops.shape, 0.0, 0.0, 1.0, 0.0, 1.0)
    leaps = leaps_of(stops)
    with np.errstate(divide="ignore", invalid="ignore"):  # as plain Python, of rays along an axis
        for start, stop in parts or [(0, len(starts))]:
            lengths(x, np.zeros(2), across, leaps, frame, limit, FOUR, out, start, stop)
    return out.reshape(len(starts), len(ways))


def ends(stops, start, way):
    """[(length, what is there)]: all that a ray may end at. It is one thing, except where the ray
    goes through a corner of cells, at which it may meet either neighbour, or none.

    A start on a border is in the cell whose lower border that is, as everywhere; so is a ray along
    a border.
    """
    (x, y), (a, b) = map(Fraction, start), map(Fraction, way)
    height, width = stops.shape
    column, row = floor(x), floor(y)

    def at(column, row):
        return stops[row, column] if 0 <= row < height and 0 <= column < width else UNSEEN

    if at(column, row) != PASSABLE:
        return [(Fraction(0), at(column, row))]
    right, up = (1 if a > 0 else -1), (1 if b > 0 else -1)
    found = []
    if (x, y) == (column, row) and a * b < 0:  # from a corner past a cell that it touches there
        found = [(Fraction(0), at(column - 1, row - 1))]
    while True:
        to_column = (column + (a > 0) - x) / a if a else BEYOND
        to_row = (row + (b > 0) - y) / b if b else BEYOND
        length = min(to_column, to_row)
        if to_column == to_row:
            found += [(length, at(column + right, row)), (length, at(column, row + up))]
        column += right if to_column == length else 0
        row += up if to_row == length else 0
        found.append((length, at(column, row)))
        if found[-1][1] != PASSABLE:
            break
    return [end for end in found if end[1] != PASSABLE]


def is_right(length, possible, limit=np.inf):
    """Whether one of the possible ends is what was found: to 1e-9, also of the limit."""
    for exactly, met in possible:
        near = float(exactly)
        if near > limit - 1e-9 and length == np.inf:
            return True
        if near < limit + 1e-9 and met == UNSEEN and np.isnan(length):
            return True
        if near < limit + 1e-9 and met == SOLID and abs(length - near) <= 1e-9:
            return True
    return False


def assert_right(stops, starts, ways, limit=np.inf):
    """Returns the share of rays that could end in one way alone."""
    found, single = cast(stops, starts, ways, limit), 0
    for start, row in zip(starts, found, strict=True):
        for way, length in zip(ways, row, strict=True):
            possible = ends(stops, start, way)
            assert is_right(length, possible, limit), (start, way, length, possible)
            single += len(possible) == 1
    return single / found.size


WAYS = st.tuples(st.integers(-12, 12), st.integers(-12, 12)).filter(any)
EIGHTHS = st.integers(-12, 120).map(lambda n: n / 8.0)  # on and off borders and the map
MAPS = arrays(
    np.uint8,
    array_shapes(min_dims=2, max_dims=2, max_side=12),
    elements=st.sampled_from([PASSABLE] * 6 + [SOLID, UNSEEN]),
)


@given(
    MAPS,
    st.lists(st.tuples(EIGHTHS, EIGHTHS), min_size=1, max_size=6),
    st.lists(WAYS, min_size=1, max_size=6),
    st.sampled_from([np.inf, 0.31, 1.7]),
)
@settings(max_examples=200)
def test_rays_from_rational_places_in_rational_directions(inner, starts, ways, limit):
    assert_right(ringed(inner), starts, ways, limit)


@pytest.mark.parametrize("seed", range(4))
def test_rays_from_corners_borders_and_middles(seed):
    """All 8 directions along axes and diagonals and 24 others, from every half cell."""
    rng = np.random.default_rng(seed)
    stops = ringed(rng.choice([PASSABLE, SOLID, UNSEEN], (5, 7), p=[0.8, 0.1, 0.1]))
    starts = [(x / 2.0, y / 2.0) for x in range(-1, 19) for y in range(-1, 15)]
    ways = [(a, b) for a in range(-3, 4) for b in range(-3, 4) if np.gcd(a, b) == 1]
    assert len(ways) == 32
    assert assert_right(stops, starts, ways) > 0.5


def random_rays(rng, stops, n, ways):
    """Places and directions as any numbers are, a few of the directions nearly along an axis."""
    height, width = stops.shape
    starts = rng.uniform([-0.5, -0.5], [width + 0.5, height + 0.5], (n, 2))
    turn = rng.uniform(-np.pi, np.pi, ways)
    turn[::4] = np.rint(turn[::4] / (np.pi / 2.0)) * (np.pi / 2.0) + rng.choice([1e-4, -1e-7, 0.0])
    return starts, np.stack([np.cos(turn), np.sin(turn)], axis=-1)


@pytest.mark.parametrize("seed", range(12))
def test_rays_from_anywhere_in_any_direction(seed):
    """Each with one end: no random ray goes through a corner."""
    rng = np.random.default_rng(seed)
    free = (0.98, 0.9, 0.7)[seed % 3]
    p = [free, (1.0 - free) / 2.0, (1.0 - free) / 2.0]
    stops = ringed(rng.choice([PASSABLE, SOLID, UNSEEN], rng.integers(1, 25, 2), p=p))
    starts, ways = random_rays(rng, stops, 12, 12)
    assert assert_right(stops, starts, ways, limit=rng.choice([np.inf, 5.3])) == 1.0


HALL = pytest.param(
    (620, 610),
    marks=pytest.mark.skipif(AS_PYTHON, reason="3 million leaps take 4 s as plain Python"),
)


@pytest.mark.parametrize("shape", [HALL, (3, 900), (900, 4)])
def test_rays_through_more_open_space_than_the_largest_leap(shape):
    rng = np.random.default_rng(1)
    inner = np.full(shape, PASSABLE)
    inner[rng.integers(0, shape[0], 3), rng.integers(0, shape[1], 3)] = SOLID
    inner[[0, -1]] = SOLID
    stops = ringed(inner)
    leaps = leaps_of(stops)
    assert (leaps == LARGEST_LEAP).any() or min(shape) < 10
    starts, ways = random_rays(rng, stops, 6, 12)
    assert assert_right(stops, starts, ways) == 1.0
    assert_right(stops, np.floor(starts * 2.0) / 2.0, [(1, 0), (0, -1), (-1, 1), (700, -1), (1, 2)])


@pytest.fixture(scope="module")
def mixed():
    """A map, places inside it, outside, in walls and in the unknown, and no place at all."""
    rng = np.random.default_rng(2)
    inner = rng.choice([PASSABLE, SOLID, UNSEEN], (20, 30), p=[0.96, 0.03, 0.01])
    inner[[0, -1]] = inner[:, [0, -1]] = SOLID
    stops, starts = ringed(inner), rng.uniform([-3.0, -3.0], [35.0, 25.0], (18, 2))
    wall, unknown = (np.argwhere(stops == what)[3][::-1] + 0.5 for what in (SOLID, UNSEEN))
    odd = [wall, unknown, (np.nan, 3.0), (np.inf, 3.0), (0.0, 0.0), (32.0, 22.0), (1e300, -1e300)]
    return stops, rng.permutation(np.concatenate([starts, odd]))


@pytest.mark.parametrize("beams", [1, 3, 255, 256, 257, 700])
def test_a_ray_is_the_same_whichever_are_cast_with_it(mixed, beams):
    """Same bits: for all at once, a pose at a time, and a beam at a time."""
    stops, starts = mixed
    turn = np.linspace(-np.pi, np.pi, beams)
    ways = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    found = cast(stops, starts, ways, 25.0)
    assert not (found == -7.0).any()
    for i in range(len(starts)):
        assert np.array_equal(cast(stops, starts[i], ways, 25.0), found[i : i + 1], equal_nan=True)
    for b in range(0, beams, 1 + beams // 9):
        assert np.array_equal(
            cast(stops, starts, ways[b], 25.0), found[:, b : b + 1], equal_nan=True
        )
    if beams > 200:
        assert (found == 0.0).any()
        assert 0.1 < np.isnan(found).mean() < 0.9


@pytest.mark.parametrize("beams", [1, 31, 300])
def test_any_split_of_the_particles_gives_the_same_bits(mixed, beams):
    stops, starts = mixed
    n, turn = len(starts), np.linspace(-3.0, 3.0, beams)
    ways = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    whole = cast(stops, starts, ways, 25.0)
    for parts in ([(0, 1), (1, n)], [(8, n), (0, 3), (3, 3), (3, 8)]):
        assert np.array_equal(cast(stops, starts, ways, 25.0, parts), whole, equal_nan=True)
    some = cast(stops, starts, ways, 25.0, [(3, 8)])
    assert np.array_equal(some[3:8], whole[3:8], equal_nan=True)
    assert (np.delete(some, slice(3, 8), axis=0) == -7.0).all()


@pytest.mark.parametrize(("poses", "beams"), [(0, 5), (5, 0), (0, 0)])
def test_no_rays_have_no_lengths(poses, beams):
    stops = ringed([[PASSABLE]])
    assert cast(stops, np.full((poses, 2), 1.5), np.ones((beams, 2))).shape == (poses, beams)


@pytest.mark.parametrize("beams", [1, 5, _LANES, 700])
def test_sums_are_those_of_the_table_at_the_lengths(mixed, beams):
    """By NumPy: linear between knots 1/3 of a cell apart; and any split gives the same bits."""
    stops, starts = mixed
    rng = np.random.default_rng(beams)
    turn = rng.uniform(-np.pi, np.pi, beams)
    ways = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    knots = np.arange(3 * 12 + 2) / 3.0
    table = rng.normal(size=(beams, len(knots) + 3)).astype(np.float32)
    table[:, -1] = 0.0
    expected = np.zeros(len(starts))
    for found, values in zip(cast(stops, starts, ways, 12.0).T, table.astype(float), strict=True):
        between = np.interp(np.nan_to_num(found, posinf=0.0), knots, values[:-3])
        expected += np.select([np.isinf(found), np.isnan(found)], values[-3:-1], between)
    x = np.zeros((3, len(starts)))
    x[:2] = starts.T
    frame, leaps = (*stops.shape, 0.0, 0.0, 1.0, 0.0, 1.0), leaps_of(stops)
    rays = x, np.zeros(2), np.ascontiguousarray(ways.T), leaps, frame, 12.0, table, 3.0, FOUR
    whole, split = np.full(len(starts), -7.0), np.full(len(starts), -7.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        sum_over_rays(*rays, whole, 0, len(starts))
        for start, stop in ((0, 1), (1, 9), (9, 9), (9, len(starts))):
            sum_over_rays(*rays, split, start, stop)
    steepest = np.abs(np.diff(table[:, :-3])).max()  # a difference of knots is rounded to float32
    assert np.abs(whole - expected).max() <= beams * (steepest * 2.0**-24 + 1e-12)
    assert np.array_equal(whole, split)
