"""Occupied bins against a Python dictionary of their coordinates."""

import numpy as np
import pytest

from mcloc.kernels.bins import Bins


def labels_by_dictionary(states, sides, around):
    """(n,): the number of the bin of each column, in the order of their first sight."""
    numbers, labels = {}, []
    for x in states.T:
        at = np.floor(x / sides)
        at = [c - a * np.floor(c / a) if a else c for c, a in zip(at, around, strict=True)]
        labels.append(numbers.setdefault(tuple(at), len(numbers)))
    return labels


@pytest.mark.parametrize("dimension", [1, 2, 3, 6])
@pytest.mark.parametrize("chunk", [1, 37, 400])
def test_numbers_bins_as_a_dictionary_does_whatever_the_chunk(dimension, chunk):
    rng = np.random.default_rng(dimension)
    sides, around = rng.uniform(0.1, 0.6, dimension), np.zeros(dimension)
    around[-1] = 7.0  # the last axis is circular
    states = rng.normal(0.0, 2.0, (dimension, 400))  # negative coordinates too
    states[:, 200:] = np.repeat(states[:, 200:300], 2, axis=1)  # some side by side
    bins = Bins(sides, around)
    labels = [
        bins.add(np.ascontiguousarray(states[:, k : k + chunk])) for k in range(0, 400, chunk)
    ]
    assert np.concatenate(labels).tolist() == labels_by_dictionary(states, sides, around)


def test_grows_beyond_its_first_table():
    bins = Bins(np.array([1.0]), np.zeros(1))
    first = np.arange(6000.0)[None] + 0.5
    assert bins.add(first).tolist() == list(range(6000))
    again = bins.add(np.concatenate([first, first + 3000.0], axis=1))
    assert bins.known == 9000
    assert again[:6000].tolist() == list(range(6000))
    assert again[-1] == 8999


def test_each_bin_knows_the_first_state_in_it():
    rng = np.random.default_rng(3)
    states = rng.uniform(-20.0, 20.0, (2, 5000))  # more bins than the first table holds
    bins = Bins(np.array([0.5, 0.5]), np.zeros(2))
    labels = bins.add(states)
    _, first = np.unique(labels, return_index=True)
    assert bins.known > 1024
    assert np.array_equal(bins.first[: bins.known], first)


def test_bins_come_sorted_with_keys_and_coordinates():
    rng = np.random.default_rng(4)
    states = rng.uniform(-3.0, 3.0, (3, 300))
    sides, around = np.array([0.5, 0.7, 0.3]), np.array([0.0, 0.0, 9.0])
    bins = Bins(sides, around)
    labels = bins.add(states)
    order, keys, at = bins.sorted()
    assert (np.diff(keys) > 0).all()
    assert np.array_equal(bins.strides @ at, keys)
    expected = np.floor(states / sides[:, None])
    expected[2] %= 9.0
    rank = np.empty(bins.known, dtype=int)
    rank[order] = np.arange(bins.known)
    assert np.array_equal(at[:, rank[labels]], expected)


def test_neighbours_across_a_border_are_two_bins():
    bins = Bins(np.array([0.25, 0.25, 0.17]), np.zeros(3))
    x = np.array([[0.249, 0.251, -0.001], [0.1, 0.1, 0.1], [0.0, 0.0, 0.0]])
    assert bins.add(x).tolist() == [0, 1, 2]
