"""Sums of weights against SciPy's log-sum-exp and plain NumPy."""

import os

import numpy as np
import pytest
from scipy.special import logsumexp

from mcloc.kernels import jit
from mcloc.kernels.weights import _BLOCK, log_sums, weights

SIZES = [1, 2, 3, 4, 5, 4095, 4096, 4097, 8192, 3 * 4096 + 1]
SCALES = 0.0, 1.0, 0.3
EPS = 2.0**-53
AS_PYTHON = "NUMBA_DISABLE_JIT" in os.environ
not_as_python = pytest.mark.skipif(
    AS_PYTHON, reason="NumPy refuses to make what is no number a whole one"
)


def expected(a, b, scale):
    return logsumexp(a if scale == 0.0 else a + scale * b)


def allowed(n, result):
    """Rounding of the sums: ≤ 1024 additions a quarter of a block, one a block; 4 eps an
    exponential, as many for SciPy's; and of the result, once for the logarithm, once for the shift.
    """
    return (1024 + n / _BLOCK + 8) * EPS + 2.0 * np.spacing(np.abs(result))


def test_the_block_is_the_one_that_the_sizes_are_about():
    assert _BLOCK == 4096


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("spread", [0.0, 1.0, 50.0])
def test_sums_are_those_of_scipy(n, spread):
    rng = np.random.default_rng(n)
    a, b = rng.normal(-3.0, spread, n), rng.normal(2.0, spread, n)
    tops, totals = log_sums(a, b, *SCALES)
    for scale, top, total in zip(SCALES, tops, totals, strict=True):
        assert top == (a + scale * b).max()
        result = expected(a, b, scale)
        assert abs(total - result) <= allowed(n, result)


@pytest.mark.parametrize("offset", [-1e5, 1e5, -700.0, 700.0, 1e12])
def test_no_offset_is_too_large(offset):
    rng = np.random.default_rng(5)
    a, b = offset + rng.normal(0.0, 3.0, 5000), rng.normal(0.0, 3.0, 5000)
    for total, scale in zip(log_sums(a, b, *SCALES)[1], SCALES, strict=True):
        result = expected(a, b, scale)
        assert abs(total - result) <= allowed(5000, result)


def test_blocks_far_apart():
    """One block of next to nothing beside one of weight, whichever comes first, and blocks whose
    largest weights differ by what the sum must not lose.
    """
    for offsets in ([-900.0, 0.0, -5.0], [0.0, -900.0, 40.0], [-1e5, -1e5 - 1.0, -2e5]):
        a = np.repeat(offsets, _BLOCK) + np.linspace(0.0, 1.0, 3 * _BLOCK)
        total = log_sums(a, a, 0.0)[1][0]
        result = logsumexp(a)
        assert abs(total - result) <= allowed(len(a), result)


@pytest.mark.parametrize("n", [1, 3, 4096, 5000])
def test_no_weight_at_all(n):
    a = np.full(n, -np.inf)
    tops, totals = log_sums(a, np.ones(n), *SCALES)
    assert tops.tolist() == totals.tolist() == [-np.inf] * 3


@pytest.mark.parametrize("n", [2, 4, 4097, 9000])
def test_particles_of_no_weight_among_others(n):
    """At the ends, a whole block of them, and more or less everywhere."""
    rng = np.random.default_rng(n)
    full = rng.normal(size=n)
    patterns = [np.arange(n) == 0, np.arange(n) == n - 1, np.arange(n) < _BLOCK]
    for none in (*patterns, rng.random(n) < 0.9):
        for where in ("a", "b"):
            a, b = full.copy(), full.copy()
            (a if where == "a" else b)[none] = -np.inf
            for total, scale in zip(log_sums(a, b, *SCALES)[1], SCALES, strict=True):
                result = expected(a, b, scale)
                assert total == result or abs(total - result) <= allowed(n, result)


@pytest.mark.parametrize("n", SIZES)
def test_equal_weights_sum_to_their_number(n):
    """One half ulp for the logarithm, one for the shift."""
    for value in (0.0, -np.log(n), -1234.5):
        tops, totals = log_sums(np.full(n, value), np.zeros(n), 0.0, 0.7)
        result = value + np.log(n)
        assert tops.tolist() == [value] * 2
        assert totals == pytest.approx(result, rel=0.0, abs=2.0 * np.spacing(abs(value) + 10.0))


def test_equal_but_for_one():
    """What takes the way of equal weights must be equal: one lighter, and one heavier by little."""
    for other in (-1e-9, 1e-9, -np.inf, 3.0):
        for at in (0, 1, 4095, 4096, 8191):
            a = np.zeros(2 * _BLOCK)
            a[at] = other
            total, result = log_sums(a, a, 0.0)[1][0], logsumexp(a)
            assert abs(total - result) <= allowed(len(a), result)


def test_scale_0_leaves_b_out():
    a = np.linspace(-2.0, 0.0, 10)
    b = np.array([np.nan, np.inf, -np.inf, *np.full(7, 1e308)])
    tops, totals = log_sums(a, b, 0.0)
    assert tops.tolist() == [0.0]
    assert totals[0] == pytest.approx(logsumexp(a), abs=1e-14)


@not_as_python
@pytest.mark.parametrize("n", [1, 5, 4096, 9000])
def test_one_nan_is_told(n):
    """Whatever else there is, equal weights, +∞ or none at all, in its block and in others."""
    for others in (0.0, np.inf, -np.inf):
        for at in {0, n // 2, n - 1}:
            a = np.full(n, others)
            a[at] = np.nan
            assert np.isnan(log_sums(a, np.zeros(n), 0.0, 1.0)[0]).all()
            tops, _ = log_sums(np.zeros(n), a, 0.0, 1.0)
            assert tops[0] == 0.0
            assert np.isnan(tops[1])


@not_as_python
@pytest.mark.parametrize("n", [1, 5, 4096, 9000])
def test_an_infinite_weight_is_told(n):
    for others in (0.0, 800.0, -np.inf):
        for at in {0, n // 2, n - 1}:
            a = np.full(n, others)
            a[at] = np.inf
            assert log_sums(a, np.zeros(n), 0.0, 1.0)[0].tolist() == [np.inf] * 2


@not_as_python
def test_infinity_less_infinity_is_told():
    a, b = np.array([0.0, np.inf]), np.array([0.0, -np.inf])
    tops, _ = log_sums(a, b, 0.0, 0.5)
    assert tops[0] == np.inf
    assert np.isnan(tops[1])


@pytest.mark.parametrize("n", [*SIZES, 32768, 2 * 32768 + 5])
def test_weights_are_exponentials(n):
    rng = np.random.default_rng(n)
    a = -rng.exponential(60.0, n)
    a[rng.random(n) < 0.1] = -np.inf
    a[0] = 0.0
    w, total, squares = weights(a)
    exact = np.exp(a.astype(np.longdouble))
    to_two_units = 4.0 * EPS * exact + np.where(a < -708.0, 4e-308, 0.0)  # 0 is near enough there
    assert (np.abs(w - exact) <= to_two_units).all()
    assert (w[a == -np.inf] == 0.0).all()
    bound = 1024 + n / _BLOCK + 8  # additions, exponentials and products
    assert abs(total / exact.sum() - 1.0) <= bound * EPS
    assert abs(squares / (exact**2).sum() - 1.0) <= (bound + 5) * EPS


def test_no_weights_are_no_weights():
    w, total, squares = weights(np.empty(0))
    assert w.shape == (0,)
    assert (total, squares) == (0.0, 0.0)


def test_no_number_of_threads_changes_a_bit(monkeypatch, set_threads):
    monkeypatch.setattr(jit, "SERIAL_BELOW", 0)
    rng = np.random.default_rng(6)
    a, b = -rng.exponential(5.0, 5 * _BLOCK + 77), rng.normal(size=5 * _BLOCK + 77)
    many, found = -rng.exponential(5.0, 200_001), []
    for threads in (1, 2, 3, 5):
        set_threads(threads)
        found.append(np.concatenate([*log_sums(a, b, *SCALES), *map(np.atleast_1d, weights(many))]))
    for other in found[1:]:
        assert np.array_equal(found[0], other)
