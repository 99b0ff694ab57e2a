"""Counting occupied bins against a Python set of bin coordinates."""

import numpy as np
import pytest

from mcloc.kernels.bins import BinCounter


def occupied_by_set(states, sides):
    """(n,): distinct bins up to and with each column."""
    seen, counts = set(), []
    for x in states.T:
        seen.add(tuple(int(c) for c in np.floor(x / sides)))
        counts.append(len(seen))
    return np.array(counts)


@pytest.mark.parametrize("dimension", [1, 2, 3, 6])
@pytest.mark.parametrize("chunk", [1, 37, 400])
def test_counts_as_a_set_does_whatever_the_chunk(dimension, chunk):
    rng = np.random.default_rng(dimension)
    sides = rng.uniform(0.1, 0.6, dimension)
    states = rng.normal(0.0, 2.0, (dimension, 400))  # negative coordinates too
    counter = BinCounter(sides)
    counts = np.concatenate(
        [counter.add(np.ascontiguousarray(states[:, k : k + chunk])) for k in range(0, 400, chunk)]
    )
    assert np.array_equal(counts, occupied_by_set(states, sides))


def test_grows_beyond_its_first_table():
    side = np.array([1.0])
    counter = BinCounter(side)
    first = np.arange(6000.0)[None] + 0.5
    assert counter.add(first)[-1] == 6000
    again = np.concatenate([first, first + 3000.0], axis=1)
    assert counter.add(again)[-1] == 9000


def test_neighbours_across_a_border_are_two_bins():
    counter = BinCounter(np.array([0.25, 0.25, 0.17]))
    x = np.array([[0.249, 0.251, -0.001], [0.1, 0.1, 0.1], [0.0, 0.0, 0.0]])
    assert counter.add(x).tolist() == [1, 2, 3]
