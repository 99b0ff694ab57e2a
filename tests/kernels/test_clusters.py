"""Neighbours and smoothing against plain NumPy; hills against SciPy's prominences of peaks."""

import itertools

import numpy as np
import pytest
from scipy.signal import find_peaks, peak_prominences

from mcloc.kernels.clusters import find_neighbours, join_hills, smooth

OFFSETS = np.array(list(itertools.product((-1, 0, 1), repeat=3)))


@pytest.fixture
def bins():
    """Sorted keys and coordinates of 300 occupied bins; the third axis goes around after 6."""
    rng = np.random.default_rng(4)
    extent = np.array([12, 9, 6])
    strides = np.array([1, 12, 108])
    at = np.stack([rng.integers(1, 11, 300), rng.integers(1, 8, 300), rng.integers(0, 6, 300)])
    keys = np.unique(strides @ at)
    coordinates = np.stack([keys // s % e for s, e in zip(strides, extent, strict=True)])
    return keys, coordinates, strides


def neighbours_of(bins):
    keys, coordinates, strides = bins
    out = np.empty((len(keys), len(OFFSETS)), dtype=np.int64)
    find_neighbours(keys, coordinates, OFFSETS, np.array([0, 0, 6]), strides, out)
    return out


def test_neighbours_are_those_of_a_dictionary(bins):
    _, coordinates, _ = bins
    index = {tuple(c): k for k, c in enumerate(coordinates.T.tolist())}
    expected = [
        [index.get((x + dx, y + dy, (t + dt) % 6), -1) for dx, dy, dt in OFFSETS.tolist()]
        for x, y, t in coordinates.T.tolist()
    ]
    assert np.array_equal(neighbours_of(bins), expected)


def test_smoothing_is_a_weighted_sum(bins):
    neighbours = neighbours_of(bins)
    rng = np.random.default_rng(5)
    mass, weights = rng.random(len(neighbours)), rng.random(len(OFFSETS))
    out = np.empty(len(mass))
    smooth(mass, neighbours, weights, out)
    expected = (np.where(neighbours >= 0, mass[neighbours], 0.0) * weights).sum(axis=1)
    assert out == pytest.approx(expected)


def hills_in_a_row(density, valley):
    """(K,): the top of each bin's hill, for bins that touch those beside them."""
    n = len(density)
    at = np.arange(n)
    neighbours = np.stack([at - 1, at, np.where(at + 1 < n, at + 1, -1)], axis=1)
    root = np.empty(n, dtype=np.int64)
    join_hills(np.argsort(-density, kind="stable"), density, neighbours, valley, root)
    return root


@pytest.mark.parametrize("valley", [0.2, 0.5, 0.8])
def test_hills_are_the_peaks_that_stand_out(valley):
    """A peak p is a hill of its own where the highest pass to a higher one is below valley · p."""
    for seed in range(30):
        density = np.random.default_rng(seed).random(60)
        padded = np.pad(density, 1)
        peaks, _ = find_peaks(padded)
        passes = padded[peaks] - peak_prominences(padded, peaks)[0]
        expected = peaks[passes < valley * padded[peaks]] - 1
        root = hills_in_a_row(density, valley)
        assert np.array_equal(np.unique(root), expected)
        assert (density[root] >= density).all()


def test_a_shallow_valley_joins_and_a_deep_one_parts():
    shallow = np.array([1.0, 4.0, 2.2, 3.0, 0.5])
    deep = np.array([1.0, 4.0, 1.4, 3.0, 0.5])
    assert hills_in_a_row(shallow, 0.5).tolist() == [1, 1, 1, 1, 1]
    assert hills_in_a_row(deep, 0.5).tolist() == [1, 1, 1, 3, 3]
