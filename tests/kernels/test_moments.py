"""Sums over the particles of each bin against plain NumPy in extended precision."""

import numpy as np
import pytest

from mcloc.kernels import jit
from mcloc.kernels.moments import moments_of_bins

EPS = 2.0**-53
EXTENDED = np.longdouble
PI = EXTENDED("3.14159265358979323846264")
SPACES = [(False,), (True,), (False, False, True), (False, False, True, True, False, True)]
BINS = 13
SIDE = 0.25


def wrapped(angle):
    return angle - 2.0 * PI * np.rint(angle / (2.0 * PI))


def bins_of(circular, n, far=0.0):
    """states (D, n), weights (n,), labels (n,), reference (D, K): bins anywhere, the first of them
    across ±π.
    """
    rng = np.random.default_rng(n)
    circular = np.array(circular)
    corner = far * rng.choice([-1.0, 1.0], (len(circular), BINS)) + rng.uniform(
        -9.0, 9.0, (len(circular), BINS)
    )
    corner[circular, 0] = np.pi - 0.1
    labels = rng.permutation(np.arange(n) % BINS).astype(np.int32)
    states = corner[:, labels] + rng.uniform(0.0, SIDE, (len(circular), n))
    states[circular] = -np.arctan2(-np.sin(states[circular]), np.cos(states[circular]))
    _, first = np.unique(labels, return_index=True)
    return states, rng.exponential(size=n), labels, np.ascontiguousarray(states[:, first])


@pytest.mark.parametrize("circular", SPACES, ids=str)
@pytest.mark.parametrize("n", [BINS, 200, 3001])
@pytest.mark.parametrize("far", [0.0, 1e5])
def test_sums_are_those_over_the_particles_of_each_bin(circular, n, far):
    states, weights, labels, reference = bins_of(circular, n, far)
    d = states.astype(EXTENDED) - reference[:, labels]
    d[list(circular)] = wrapped(d[list(circular)])
    terms = [np.ones(n), *d, *(d[a] * d[b] for a in range(len(d)) for b in range(a + 1))]
    for a in np.flatnonzero(circular):
        terms += [np.sin(states[a].astype(EXTENDED)), np.cos(states[a].astype(EXTENDED))]
    found = moments_of_bins(states, weights, labels, reference, np.array(circular))
    assert found.shape == (BINS, -(-len(terms) // 4) * 4)
    assert (found[:, len(terms) :] == 0.0).all()
    for term, sums in zip(terms, found.T, strict=False):
        exactly = np.array([(weights * term)[labels == k].sum() for k in range(BINS)])
        size = np.array([np.abs(weights * term)[labels == k].sum() for k in range(BINS)])
        # n additions; d and its square are of the size of π's rounding at the least.
        rounding = (n + 8) * EPS * size + 16.0 * EPS * weights.sum()
        assert (np.abs(sums - exactly) <= rounding).all()


def test_one_particle_is_no_way_off_itself():
    for circular in SPACES:
        states = np.full((len(circular), 1), 3.1)
        label = np.zeros(1, dtype=np.int32)
        sums = moments_of_bins(states, np.full(1, 0.3), label, states, np.array(circular))[0]
        pairs = len(circular) * (len(circular) + 3) // 2
        assert sums[0] == 0.3
        assert (sums[1 : 1 + pairs] == 0.0).all()


@pytest.mark.parametrize("n", [300, 64 * BINS * 8 + 5])
def test_no_number_of_threads_changes_a_bit(monkeypatch, set_threads, n):
    """One part, and eight."""
    monkeypatch.setattr(jit, "SERIAL_BELOW", 0)
    circular = np.array([False, False, True])
    found = []
    for threads in (1, 2, 3, 5):
        set_threads(threads)
        found.append(moments_of_bins(*bins_of(circular, n), circular))
    for other in found[1:]:
        assert np.array_equal(found[0], other)
