"""Turns of rings against np.roll."""

from itertools import pairwise

import numpy as np
import pytest

from mcloc.kernels.rings import best_turns

CASES = [(8, 8), (16, 5), (17, 4), (90, 46), (90, 90), (96, 1), (120, 0), (255, 255), (256, 256)]


def matched(rings, sectors, values, *edges):
    turns, apart = (np.full(len(rings), -1, dtype=np.int32) for _ in range(2))
    for start, stop in pairwise(edges):
        best_turns(rings, sectors, values.astype(np.int16), turns, apart, start, stop)
    return turns, apart


@pytest.mark.parametrize(("around", "used"), CASES)
def test_each_ring_is_turned_to_where_it_is_most_like(around, used):
    rng = np.random.default_rng(around + used)
    rings = rng.integers(0, 256, (30, around)).astype(np.uint8)
    sectors = np.sort(rng.choice(around, used, replace=False))
    values = rng.integers(0, 256, used)
    all_turns = np.stack([np.roll(rings, -s, axis=1)[:, sectors] for s in range(around)])
    total = np.abs(all_turns.astype(int) - values).sum(axis=2)
    turns, apart = matched(rings, sectors, values, 0, 30)
    assert np.array_equal(turns, total.argmin(axis=0))  # the first of several
    assert np.array_equal(apart, total.min(axis=0))


@pytest.mark.parametrize("around", [90, 256])
def test_the_largest_difference_fits(around):
    rings = np.zeros((2, around), dtype=np.uint8)
    turns, apart = matched(rings, np.arange(around), np.full(around, 255), 0, 2)
    assert turns.tolist() == [0, 0]
    assert apart.tolist() == [255 * around] * 2


def test_a_part_of_the_rings_gives_the_same():
    rng = np.random.default_rng(1)
    rings = rng.integers(0, 256, (50, 90)).astype(np.uint8)
    sectors, values = np.arange(3, 50), rng.integers(0, 256, 47)
    whole = matched(rings, sectors, values, 0, 50)
    parts = matched(rings, sectors, values, 0, 1, 17, 50)
    assert np.array_equal(whole, parts)
