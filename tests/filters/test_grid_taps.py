"""Selling's decomposition and the taps that it makes, against the covariances that went in."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ndtr

from mcloc.filters.grid_taps import LEAST_RATIO, MOST_SENT, taps
from mcloc.filters.selling import selling


def covariances(seed, n, d, ratio):
    """(n, d, d): turned at random, of any size, with a least eigenvalue of `ratio` of the
    largest.
    """
    rng = np.random.default_rng(seed)
    turned = np.linalg.qr(rng.normal(size=(n, d, d)))[0]
    values = np.exp(rng.uniform(np.log(ratio), 0.0, (n, d)))
    values[:, 0], values[:, -1] = ratio, 1.0
    values *= np.exp(rng.uniform(-7.0, 4.0, (n, 1)))
    return np.einsum("nab,nb,ncb->nac", turned, values, turned)


# Selling's decomposition


@settings(max_examples=100)
@given(seed=st.integers(0, 2**32), ratio=st.sampled_from([1.0, 0.3, 0.1, 0.01, LEAST_RATIO, 1e-4]))
def test_selling_is_exact_with_weights_that_are_not_negative(seed, ratio):
    c = covariances(seed, 50, 2, ratio)
    weights, e = selling(c)
    assert (weights >= 0.0).all()
    assert np.issubdtype(e.dtype, np.integer)
    again = np.einsum("ni,nia,nib->nab", weights, e, e)
    assert (np.abs(again - c).max(axis=(1, 2)) <= 1e-10 * np.trace(c, axis1=1, axis2=2)).all()
    # To be narrower than a cell it need not look farther than the noise is long for its breadth.
    assert np.abs(e).max() <= np.sqrt(1.0 / ratio) + 1.0


def test_selling_of_a_diagonal_matrix_are_its_axes():
    weights, e = selling(np.diag([3.0, 0.5])[None])
    found = {tuple(np.abs(v)): w for v, w in zip(e[0], weights[0], strict=True) if w > 0}
    assert found == pytest.approx({(1, 0): 3.0, (0, 1): 0.5})


def test_selling_of_nothing_is_nothing():
    assert selling(np.zeros((2, 2, 2)))[0].max() == 0.0


# Taps, by what they do to a cell


def by_source(rounds, offsets):
    """For each round: K lists of (weight, Δx, Δy, Δslice) of what leaves a cell of each slice, Δx
    and Δy with how far the cells of the slice that it comes to lie elsewhere.
    """
    count, found = len(offsets), []
    for r in rounds:
        of_round = [[] for _ in range(count)]
        for target in range(count):
            for source, row, column, w in zip(
                r.slices[target], r.rows[target], r.columns[target], r.weights[target], strict=True
            ):
                if w > 0.0:
                    dx, dy = np.array([column, row]) + offsets[target] - offsets[source]
                    turned = (target - source + count // 2) % count - count // 2
                    of_round[source].append((float(w), dx, dy, turned))
        found.append(of_round)
    return found


def moments(leaving):
    """Mass, mean and covariance of the mass of one cell."""
    table = np.array(leaving)
    w, moves = table[:, 0], table[:, 1:]
    mean = w @ moves / w.sum()
    return w.sum(), mean, np.einsum("n,na,nb->ab", w, moves - mean, moves - mean) / w.sum()


def sums(rounds, offsets):
    """Mass (product), mean and covariance (sums) over all rounds, for each slice; and the mass that
    changes the slice, also a sum.
    """
    count = len(offsets)
    mass, mean, c, changed = np.ones(count), np.zeros((count, 3)), np.zeros((count, 3, 3)), 0.0
    for of_round in by_source(rounds, offsets):
        for k, leaving in enumerate(of_round):
            m, one, spread = moments(leaving)
            mass[k] *= m
            mean[k] += one
            c[k] += spread
        changed += np.array([sum(t[0] for t in leaving if t[3]) for leaving in of_round])
    return mass, mean, c, changed


COUNT = 300  # slices: of noise in these tests nothing goes around the circle


def given_heading(c):
    """(K, 2, 2): the covariance of x and y for a known θ."""
    known = c[:, :2, 2, None] * c[:, 2, None, :2] / c[:, 2, 2, None, None]
    return c[:, :2, :2] - known


def expected(c):
    """(K, 3, 3): with S not narrower than it may be."""
    s = given_heading(c)
    values, vectors = np.linalg.eigh(s)
    values = np.maximum(values, LEAST_RATIO * values[:, -1:])
    wanted = c.copy()
    wanted[:, :2, :2] += np.einsum("nab,nb,ncb->nac", vectors, values, vectors) - s
    return wanted


def noises(seed, ratio, size):
    """(K, 3, 3): what is largest in each is `size`; the variance of θ is the same in all."""
    c = covariances(seed, COUNT, 3, ratio)
    c *= (size / c.max(axis=(1, 2)))[:, None, None]
    c[:, 2, :] *= np.sqrt(c[0, 2, 2] / c[:, 2, 2])[:, None]
    c[:, :, 2] = c[:, 2, :]
    c[:, 2, 2] = c[0, 2, 2]
    return c


NOISES = pytest.mark.parametrize(
    ("ratio", "size"),
    list(itertools.product([0.3, 0.02, LEAST_RATIO, 1e-6], [0.01, 0.4, 1.0, 3.0, 20.0])),
)


@NOISES
def test_taps_keep_mass_mean_and_covariance_where_cells_of_all_slices_meet(ratio, size):
    """Slices that lie alike, and a slope of whole cells."""
    c = noises(5, ratio, size)
    slope = np.rint(c[:, :2, 2] / c[:, 2, 2, None])
    c[:, :2, :2] = given_heading(c) + np.einsum("na,nb,n->nab", slope, slope, c[:, 2, 2])
    c[:, :2, 2] = c[:, 2, :2] = slope * c[:, 2, 2, None]
    offsets = np.tile([3.4, -7.9], (COUNT, 1))
    mass, mean, found, _ = sums(taps(c, offsets), offsets)
    scale = 1e-6 * np.abs(c).max()
    assert mass == pytest.approx(1.0, abs=1e-6)
    assert np.abs(mean).max() < scale
    assert np.abs(found - expected(c)).max() < 3.0 * scale


@NOISES
def test_slices_that_merge_cost_what_is_said(ratio, size):
    """Mean, θ and all that goes with it are exact. x and y get nothing less than they should, and
    at most ¼ cell² of the mass that changes the slice more.
    """
    c = noises(6, ratio, size)
    offsets = np.random.default_rng(7).uniform(0.0, 200.0, (COUNT, 2))
    mass, mean, found, changed = sums(taps(c, offsets), offsets)
    small = 3e-5 * max(size, 1.0)
    assert mass == pytest.approx(1.0, abs=1e-6)
    assert np.abs(mean).max() < small
    assert np.abs((found - c)[:, 2]).max() < small
    cost = np.linalg.eigvalsh((found - c)[:, :2, :2])
    assert cost.min() > -small
    narrowest = LEAST_RATIO * np.linalg.eigvalsh(given_heading(c))[:, -1]
    assert (cost[:, 1] <= 0.25 * changed + narrowest + small).all()
    assert (changed <= np.minimum(c[:, 2, 2], 1.0) + 1e-6).all()


def test_it_costs_nothing_where_x_and_y_have_noise_of_their_own():
    """¼ cell² of what changes the slice is less than that."""
    c = np.tile(np.diag([0.2, 0.3, 0.4]), (COUNT, 1, 1))
    c[:, 0, 2] = c[:, 2, 0] = 0.1
    c[:, 1, 2] = c[:, 2, 1] = -0.04
    offsets = np.random.default_rng(8).uniform(0.0, 200.0, (COUNT, 2))
    _, mean, found, changed = sums(taps(c, offsets), offsets)
    assert changed == pytest.approx(0.4, abs=1e-6)
    assert np.abs(mean).max() < 1e-6
    assert np.abs(found - c).max() < 1e-6


def normal(variance):
    """(COUNT,): the mass of each cell around the middle one."""
    edges = np.arange(-COUNT // 2, COUNT // 2 + 1) - 0.5
    return np.diff(ndtr(edges / np.sqrt(variance)))


def apart(found, variance):
    """Total variation; 0.5 if every other cell is empty."""
    return 0.5 * np.abs(found - normal(variance)).sum()


TOTALS = pytest.mark.parametrize("total", [0.05, 0.3, 0.5, 0.50001, 1.0, 2.0, 7.0, 60.0, 700.0])


@TOTALS
def test_turns_are_normal_and_come_in_one_round(total):
    """So that slices merge once in a step."""
    (only,) = taps(np.tile(np.diag([0.0, 0.0, total]), (COUNT, 1, 1)), np.zeros((COUNT, 2)))
    line = np.bincount(only.slices[COUNT // 2], only.weights[COUNT // 2], COUNT)
    assert apart(line, total) < (0.1 if total < 0.9 else 0.03)


@TOTALS
def test_noise_along_one_axis_is_normal_and_leaves_no_holes(total):
    """A cell sends no more than half away in a round, and strides are not too long."""
    rounds = taps(np.tile(np.diag([total, 0.0, 0.0]), (3, 1, 1)), np.zeros((3, 2)))
    assert len(rounds) <= 4 + 3 * np.log2(1.0 + np.sqrt(total))
    line = np.zeros(COUNT)
    line[COUNT // 2] = 1.0
    for r in rounds:
        stays = (r.slices[0] == 0) & (r.rows[0] == 0) & (r.columns[0] == 0)
        assert r.weights[0][stays].sum() >= 1.0 - MOST_SENT - 1e-6
        along = r.rows[0] == 0  # narrow noise across has a few taps, too
        moved = sum(w * np.roll(line, c) for w, c in zip(r.weights[0], r.columns[0], strict=True))
        assert r.weights[0][~along].sum() < 2.0 * LEAST_RATIO
        line = moved
    assert apart(line, total) < (0.1 if total < 0.9 else 0.03)


def test_no_noise_has_no_rounds():
    assert taps(np.zeros((8, 3, 3)), np.zeros((8, 2))) == []


@pytest.mark.parametrize("c", [[0.0, 0.0, 0.3], [0.3, 0.0, 0.0], [0.3, 0.2, 0.0]], ids=str)
def test_noise_along_some_axes_alone(c):
    noise = np.tile(np.diag(c), (COUNT, 1, 1))
    mass, mean, found, _ = sums(taps(noise, np.zeros((COUNT, 2))), np.zeros((COUNT, 2)))
    assert mass == pytest.approx(1.0, abs=1e-6)
    assert np.abs(mean).max() < 1e-6
    assert np.abs(found - noise).max() < 2.0 * LEAST_RATIO * 0.3


def test_few_slices_and_wide_noise_go_around_the_circle():
    """Mass is kept whatever slice is which."""
    c = np.tile(np.diag([0.5, 0.1, 30.0]), (4, 1, 1))
    offsets = np.random.default_rng(9).uniform(0.0, 8.0, (4, 2))
    for r in taps(c, offsets):
        leaving = np.bincount(r.slices.ravel(), r.weights.ravel(), 4)
        assert leaving == pytest.approx(1.0, abs=1e-6)
