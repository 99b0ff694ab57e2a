"""Moments of bins and of their unions against plain NumPy in extended precision."""

import itertools

import numpy as np
import pytest

from mcloc.kernels import jit
from mcloc.kernels.moments import moments_of_bins, moments_of_groups

EPS = 2.0**-53
EXTENDED = np.longdouble
PI = EXTENDED("3.14159265358979323846264")
CIRCULAR = {1: (False,), 3: (False, False, True), 6: (False, False, True, True, False, True)}
RING = (True,)
GROUPS, BINS = 4, 13
SIDE = 0.25
WIDEST = 1.0 + SIDE  # m or rad from the middle of a group to anything in it


def wrapped(angle):
    return angle - 2.0 * PI * np.rint(angle / (2.0 * PI))


def clouds(circular, n, far=0.0, seed=0):
    """states (D, n), weights (n,), labels (n,), reference (D, K), group (K,): bins in groups that
    are 2 wide, the first two of them across ±π. One bin in four is in none.
    """
    rng = np.random.default_rng(seed)
    circular = np.array(circular)
    d = len(circular)
    middles = far * rng.choice([-1.0, 1.0], (d, GROUPS)) + rng.uniform(-9.0, 9.0, (d, GROUPS))
    middles[circular] = [np.pi, -np.pi + 0.3, 0.4, -1.9]
    group = np.arange(BINS) % (GROUPS + 1)
    corner = middles[:, group % GROUPS] + rng.uniform(-1.0, 1.0, (d, BINS))
    labels = rng.permutation(np.arange(n) % BINS).astype(np.int32)
    states = corner[:, labels] + rng.uniform(0.0, SIDE, (d, n))
    states[circular] = -np.arctan2(-np.sin(states[circular]), np.cos(states[circular]))
    _, first = np.unique(labels, return_index=True)
    reference = np.ascontiguousarray(states[:, first])
    return states, rng.exponential(size=n), labels, reference, np.where(group < GROUPS, group, -1)


def plain(states, weights, circular):
    """Mean (D,) and covariance (D, D) of some particles; and (D,) the mean of how far they are off
    that, which is 0 but for angles: their mean is that of their sines.
    """
    x, w = states.astype(EXTENDED), weights.astype(EXTENDED) / weights.astype(EXTENDED).sum()
    mean = x @ w
    for a in np.flatnonzero(circular):
        mean[a] = np.arctan2(np.sin(x[a]) @ w, np.cos(x[a]) @ w)
    off = x - mean[:, None]
    off[list(circular)] = wrapped(off[list(circular)])
    return mean, (off * w) @ off.T, np.abs(off @ w)


def of_groups(states, weights, labels, reference, group, circular):
    circular = np.array(circular)
    sums = moments_of_bins(states, weights, labels, reference, circular)
    groups, d = group.max() + 1, len(circular)
    mean, covariance = np.full((groups, d), 7.0), np.full((groups, d, d), 7.0)
    moments_of_groups(sums, reference, circular, group, mean, covariance)
    return mean, covariance


@pytest.mark.parametrize("circular", [*CIRCULAR.values(), RING], ids=str)
@pytest.mark.parametrize("n", [BINS, 200, 3001])
def test_sums_are_those_over_the_particles_of_each_bin(circular, n):
    states, weights, labels, reference, _ = clouds(circular, n)
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


@pytest.mark.parametrize("far", [0.0, 1e5, 1e7])
@pytest.mark.parametrize("circular", [*CIRCULAR.values(), RING], ids=str)
def test_groups_have_the_moments_of_their_particles(circular, far):
    """However far from the origin: what is lost of the mean there, K roundings of it, is lost of
    the covariance squared, or times how far the mean of an angle is off that of the differences.
    """
    n = 3001
    states, weights, labels, reference, group = clouds(circular, n, far)
    mean, covariance = of_groups(states, weights, labels, reference, group, circular)
    for g in range(GROUPS):
        inside = group[labels] == g
        expected, spread, between = plain(states[:, inside], weights[inside], circular)
        lost = np.where(circular, 0.0, 2.0 * BINS * EPS * (far + 10.0)) + 2.0 * n * EPS * WIDEST
        off = mean[g] - expected
        off[list(circular)] = wrapped(off[list(circular)])
        assert (np.abs(off) <= lost).all()
        rounding = 2.0 * n * EPS * WIDEST**2 + np.outer(lost, lost)
        rounding += np.outer(lost, between) + np.outer(between, lost)
        assert (np.abs(covariance[g] - spread) <= rounding).all()
        assert np.array_equal(covariance[g], covariance[g].T)
        assert (spread.diagonal() > 0.8 * SIDE**2 / 12.0).all()  # that within the bins alone
    assert (mean[:, list(circular)] > -np.pi).all()
    assert (mean[:, list(circular)] <= np.pi).all()


@pytest.mark.parametrize("heading", [np.pi, -np.pi + 1e-12, np.pi - 0.1, 0.0])
def test_two_headings_on_both_sides_of_the_seam(heading):
    """In one bin, and in two: mean and variance by hand."""
    off = np.array([-0.1, 0.2])
    states = np.stack([[2.0, 4.0], -np.mod(-(heading + off) + np.pi, 2.0 * np.pi) + np.pi])
    circular = np.array([False, True])
    for labels in ([0, 0], [0, 1]):
        labels = np.array(labels, dtype=np.int32)
        reference = np.ascontiguousarray(states[:, : labels.max() + 1])
        group = np.zeros(labels.max() + 1, dtype=np.intp)
        mean, covariance = of_groups(states, np.ones(2), labels, reference, group, circular)
        assert mean[0, 0] == pytest.approx(3.0)
        assert np.exp(1j * mean[0, 1]) == pytest.approx(np.exp(1j * (heading + 0.05)))
        assert covariance[0] == pytest.approx(np.array([[1.0, 0.15], [0.15, 0.0225]]))


@pytest.mark.parametrize("circular", [*CIRCULAR.values(), RING], ids=str)
def test_one_particle_spreads_no_more_than_its_place_is_rounded(circular):
    """A mean w x / w is x but for 2 roundings, one of angles by their sines but for some 4."""
    rng = np.random.default_rng(7)
    d = len(circular)
    for place, weight in itertools.product((1.0, 1e5), (1.0, 0.3, 1e-200)):
        states = place * rng.uniform(-1.0, 1.0, (d, 1))
        states[list(circular)] = rng.uniform(-np.pi, np.pi, (sum(circular), 1))
        label, group = np.zeros(1, dtype=np.int32), np.zeros(1, dtype=np.intp)
        mean, covariance = of_groups(states, np.full(1, weight), label, states, group, circular)
        lost = 4.0 * np.spacing(np.maximum(np.abs(states[:, 0]), 1.0))
        assert (np.abs(mean[0] - states[:, 0]) <= lost).all()
        assert (np.abs(covariance[0]) <= np.outer(lost, lost)).all()
        if weight == 1.0:
            straight = ~np.array(circular)
            assert (covariance[0][np.ix_(straight, straight)] == 0.0).all()


def test_bins_in_no_group_count_nowhere():
    states, weights, labels, reference, group = clouds((False, True), 300)
    mean, covariance = of_groups(states, weights, labels, reference, group, (False, True))
    weights = np.where(group[labels] < 0, 1e6, weights)
    again = of_groups(states, weights, labels, reference, group, (False, True))
    assert np.array_equal(again[0], mean)
    assert np.array_equal(again[1], covariance)


def test_particles_of_no_weight_count_nowhere():
    states, weights, labels, reference, group = clouds((False, False, True), 500)
    none = np.arange(500) >= 250
    weights[none] = 0.0
    mean, covariance = of_groups(states, weights, labels, reference, group, (False, False, True))
    few = (a[..., ~none] for a in (states, weights, labels))
    expected = of_groups(*map(np.ascontiguousarray, few), reference, group, (False, False, True))
    assert mean == pytest.approx(expected[0], abs=1000 * EPS * 10.0)
    assert covariance == pytest.approx(expected[1], abs=1000 * EPS * WIDEST**2)


@pytest.mark.parametrize("n", [300, 64 * BINS * 8 + 5])
def test_no_number_of_threads_changes_a_bit(monkeypatch, set_threads, n):
    """One part, and eight."""
    monkeypatch.setattr(jit, "SERIAL_BELOW", 0)
    states, weights, labels, reference, _ = clouds((False, False, True), n)
    found = []
    for threads in (1, 2, 3, 5):
        set_threads(threads)
        circular = np.array([False, False, True])
        found.append(moments_of_bins(states, weights, labels, reference, circular))
    for other in found[1:]:
        assert np.array_equal(found[0], other)
