"""Which particle each tooth meets, against NumPy's search in the cumulative weights."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcloc.kernels.ancestors import GOLDEN, ancestors_of, ancestors_of_golden_comb, first_above
from mcloc.resampling import Search

EPS = 2.0**-53
OFFSETS = [0.0, 2.0**-33, np.pi / 10.0, 1.0 - 2.0**-33, 1.0 - EPS]
WEIGHTS = st.lists(st.just(0.0) | st.floats(1e-6, 1e3), min_size=1, max_size=40).filter(any)


def some_weights():
    """Many kinds: random ones, a few of them 0, at the ends, in runs, but for one; and heavy
    ones.
    """
    rng = np.random.default_rng(1)
    full = rng.exponential(size=60)
    at = np.arange(60)
    zero = [at < 25, at >= 40, (at > 10) & (at < 30), at % 7 == 0, rng.random(60) < 0.9, at != 33]
    yield from (np.where(none, 0.0, full) for none in zero)
    yield from (full, np.ones(1), np.ones(60), np.array([0.0, 2.5, 0.0]))
    for heavy in (0, 31, 59):
        yield np.where(at == heavy, 1e12, full)
    yield 10.0 ** rng.uniform(-12.0, 0.0, 60)


def met_by_comb(weights, scale, offset, n):
    out = np.full(n, -7, dtype=np.intp)
    first_above(weights, scale, offset, out)
    return out


def allowed(weights, scale, offset, n):
    """(n,), (n,): the first and last particle that each tooth may meet.

    Cumulative weights are sums of N numbers, each addition rounded, then scaled: teeth within
    (N + 4) eps · n of one may fall on either side.
    """
    above = np.cumsum(weights) * scale
    last = np.flatnonzero(weights)[-1]
    rounding = (len(weights) + 4) * EPS * n
    at = np.arange(n) + offset
    sides = (np.searchsorted(above, at + way * rounding, "right") for way in (-1.0, 1.0))
    return tuple(np.minimum(side, last) for side in sides)


def assert_met(found, weights, scale, offset):
    """Returns whether no tooth had a choice."""
    low, high = allowed(weights, scale, offset, len(found))
    assert (low <= found).all()
    assert (found <= high).all()
    assert (weights[found] > 0.0).all()
    return (low == high).all()


@pytest.mark.parametrize("offset", OFFSETS)
@pytest.mark.parametrize("n", [1, 2, 59, 60, 61, 1000])
def test_a_comb_meets_what_a_search_finds(offset, n):
    """As many teeth as particles, fewer, and more. Only at the least and the largest offset do any
    teeth lie so near to a border that they have a choice.
    """
    for weights in some_weights():
        scale = n / np.cumsum(weights)[-1]
        decided = assert_met(met_by_comb(weights, scale, offset, n), weights, scale, offset)
        assert decided or offset in (OFFSETS[0], OFFSETS[-1])


@given(WEIGHTS, st.integers(1, 80), st.floats(0.0, 1.0, exclude_max=True))
def test_any_comb_meets_what_a_search_finds(listed, n, offset):
    weights = np.array(listed)
    scale = n / np.cumsum(weights)[-1]
    assert_met(met_by_comb(weights, scale, offset, n), weights, scale, offset)


@pytest.mark.parametrize("n", [1, 7, 60, 200])
def test_a_comb_over_weights_that_are_whole_meets_each_so_often(n):
    """Sums of whole numbers are exact: no tooth has a choice. Those on a border meet the next."""
    rng = np.random.default_rng(n)
    times = rng.multinomial(n, np.ones(30) / 30.0)
    for offset in (0.0, 0.5, 1.0 - 2.0**-20):
        found = met_by_comb(times.astype(float), 1.0, offset, n)
        assert np.array_equal(found, np.repeat(np.arange(30), times))


def test_teeth_beyond_the_last_weight_meet_the_last_that_weighs_anything():
    """scale · Σ may be less than n, by rounding or by much."""
    weights = np.array([0.0, 1.0, 2.0, 0.0, 1.0, 0.0, 0.0])
    assert met_by_comb(weights, 1.0, 0.25, 8).tolist() == [1, 2, 2, 4, 4, 4, 4, 4]
    assert met_by_comb(weights, 1.0 - 4.0 * EPS, 1.0 - EPS, 4).tolist() == [2, 2, 4, 4]


def test_what_was_in_out_does_not_matter():
    weights = np.array([0.2, 0.0, 0.5, 0.3])
    for junk in (-1, 0, 3, 2**40):
        out = np.full(10, junk, dtype=np.intp)
        first_above(weights, 10.0, 0.5, out)
        assert out.tolist() == [0] * 2 + [2] * 5 + [3] * 3


def searched(search, teeth):
    found = np.searchsorted(search.cumulative, teeth * search.cumulative[-1], "right")
    return np.minimum(found, np.flatnonzero(np.diff(search.cumulative, prepend=0.0))[-1])


def some_teeth(search):
    """From 0 to 1, both included; all cumulative weights, and the numbers next to them."""
    rng = np.random.default_rng(2)
    on = search.cumulative / search.cumulative[-1]
    beside = (np.nextafter(on, way) for way in (-np.inf, np.inf))
    teeth = np.concatenate([rng.random(300), [0.0, 1.0, EPS, 1.0 - EPS], on, *beside])
    return np.clip(teeth, 0.0, 1.0)


def test_single_teeth_meet_exactly_what_a_search_finds():
    """The way there is another one, but what is compared is the same."""
    for weights in some_weights():
        search = Search(weights)
        teeth = some_teeth(search)
        found = search(teeth)
        assert np.array_equal(found, searched(search, teeth))
        assert (weights[found] > 0.0).all()


@given(WEIGHTS, st.lists(st.floats(0.0, 1.0), max_size=40))
def test_any_teeth_meet_exactly_what_a_search_finds(listed, teeth):
    search = Search(np.array(listed))
    assert np.array_equal(search(np.array(teeth)), searched(search, np.array(teeth)))


@given(WEIGHTS, st.randoms(use_true_random=False))
def test_the_guide_makes_it_quick_not_right(listed, random):
    """Wherever the search begins, it ends at the same particle."""
    search = Search(np.array(listed))
    teeth = some_teeth(search)
    expected = searched(search, teeth)
    for guide in ([0] * len(search.guide), [search.last] * len(search.guide), None):
        if guide is None:
            guide = [random.randint(0, len(listed) - 1) for _ in search.guide]
        found = np.empty(len(teeth), dtype=np.intp)
        guide = np.array(guide, dtype=np.intp)
        ancestors_of(teeth, search.cumulative, search.last, guide, found)
        assert np.array_equal(found, expected)


def test_the_guide_leads_near():
    """One particle more in the mean is looked at: those that begin in the same part."""
    rng = np.random.default_rng(3)
    search = Search(rng.exponential(size=2000) ** 3)
    teeth = rng.random(2000)
    begins = search.guide[(teeth * 2000).astype(int)]
    assert (begins <= search(teeth) + 1).all()
    assert np.abs(search(teeth) - begins).mean() < 1.1


@pytest.mark.parametrize("first", [0, 1, 12345, 10**7])
@pytest.mark.parametrize("offset", OFFSETS)
def test_the_golden_comb_meets_exactly_what_a_search_finds(first, offset):
    teeth = offset + np.arange(first, first + 200) * GOLDEN
    teeth -= np.floor(teeth)
    for weights in some_weights():
        search = Search(weights)
        assert np.array_equal(search.golden_comb(offset, first, 200), searched(search, teeth))


def test_the_golden_comb_in_parts():
    search = Search(np.random.default_rng(4).exponential(size=50))
    whole, parts = np.empty(90, dtype=np.intp), np.empty(90, dtype=np.intp)
    rest = search.cumulative, search.last, search.guide
    ancestors_of_golden_comb(0.3, 5, *rest, whole)
    for a, b in ((0, 1), (1, 40), (40, 40), (40, 90)):
        ancestors_of_golden_comb(0.3, 5 + a, *rest, parts[a:b])
    assert np.array_equal(whole, parts)
    assert pytest.approx(0.6180339887498949, abs=EPS) == GOLDEN
