"""Intervals cover the true value as often as they say, and agree with closed forms."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import beta, binom, norm, t

from mcloc.errors import ConfigError
from mcloc.evaluation.intervals import (
    Interval,
    holm,
    mean,
    median,
    paired_difference,
    paired_p,
    paired_ratio,
    proportion,
)

STUDIES = 400


def check_coverage(inside: float, studies: int = STUDIES) -> None:
    """95 % of the studies; outside these bounds once in 100,000 suites on either side."""
    least, most = binom.ppf([1e-5, 1.0 - 1e-5], studies, 0.95)
    assert least <= inside <= most


def covered(interval: Interval, truth: float) -> bool:
    return interval.low <= truth <= interval.high


def close(interval: Interval, limits: tuple[float, float], share: float) -> None:
    """Limits that differ by no more than a share of the width."""
    tolerance = share * (limits[1] - limits[0])
    assert interval.low == pytest.approx(limits[0], abs=tolerance)
    assert interval.high == pytest.approx(limits[1], abs=tolerance)


@pytest.mark.parametrize("n", [1, 7, 40])
def test_a_share_is_covered_at_least_as_often_as_stated_whatever_it_is(n: int) -> None:
    intervals = [proportion(k, n) for k in range(n + 1)]
    for p in np.linspace(0.001, 0.999, 97):
        inside = [covered(interval, p) for interval in intervals]
        assert binom.pmf(np.arange(n + 1), n, p)[inside].sum() >= 0.95


def test_the_limits_of_a_share_are_quantiles_of_beta_distributions() -> None:
    found = proportion(12, 20, level=0.9)
    assert found.value == 0.6
    assert found.low == pytest.approx(beta.ppf(0.05, 12, 9), abs=1e-9)
    assert found.high == pytest.approx(beta.ppf(0.95, 13, 8), abs=1e-9)


def test_none_and_all_are_shares_of_which_one_limit_is_known() -> None:
    none, every = proportion(0, 10), proportion(10, 10)
    assert (none.value, none.low) == (0.0, 0.0)
    assert none.high == pytest.approx(1.0 - 0.025**0.1)
    assert (every.value, every.high) == (1.0, 1.0)
    assert every.low == pytest.approx(0.025**0.1)


@pytest.mark.parametrize(("k", "n"), [(0, 0), (-1, 5), (6, 5)])
def test_what_is_no_share_is_refused(k: int, n: int) -> None:
    with pytest.raises(ConfigError, match=f"k = {k}, n = {n}"):
        proportion(k, n)


@pytest.mark.parametrize("level", [0.0, 1.0, -0.5, np.nan])
def test_a_level_is_between_0_and_1(level: float) -> None:
    with pytest.raises(ConfigError, match="level of confidence"):
        proportion(1, 2, level)
    with pytest.raises(ConfigError, match="level of confidence"):
        mean([1.0, 2.0], level)


def test_means_of_skewed_values_are_covered() -> None:
    rng = np.random.default_rng(1)
    found = [mean(rng.exponential(2.0, 80)) for _ in range(STUDIES)]
    check_coverage(sum(covered(interval, 2.0) for interval in found))


def test_medians_are_covered() -> None:
    rng = np.random.default_rng(2)
    found = [median(rng.lognormal(1.0, 0.5, 101)) for _ in range(150)]
    check_coverage(sum(covered(interval, np.e) for interval in found), 150)


def test_differences_of_pairs_are_covered_though_pairs_differ_much_among_each_other() -> None:
    rng = np.random.default_rng(3)
    inside = widths = 0.0
    for _ in range(STUDIES):
        shared = rng.normal(0.0, 10.0, 50)
        found = paired_difference(
            shared + rng.normal(1.0, 0.5, 50), shared + rng.normal(0.0, 0.5, 50)
        )
        inside += covered(found, 1.0)
        widths += (found.high - found.low) / STUDIES
    check_coverage(inside)
    assert widths == pytest.approx(2 * 1.96 * np.sqrt(0.5 / 50), rel=0.1)  # of the pairs alone


def test_ratios_of_pairs_are_covered() -> None:
    rng = np.random.default_rng(4)
    inside = 0
    for _ in range(STUDIES):
        b = rng.gamma(4.0, 1.0, 60)
        inside += covered(paired_ratio(2.0 * b * rng.gamma(9.0, 1.0 / 9.0, 60), b), 2.0)
    check_coverage(inside)


def test_the_mean_of_many_values_has_students_interval() -> None:
    values = np.random.default_rng(5).normal(3.0, 2.0, 400)
    found = mean(values)
    assert found.value == pytest.approx(values.mean())
    limits = t.interval(0.95, 399, values.mean(), values.std(ddof=1) / 20.0)
    close(found, limits, 0.03)  # the limits of 9999 resamples err by 1 % of the width


def test_the_interval_of_skewed_values_is_efrons() -> None:
    """BCa written out, from resamples of its own: (z₀ + z) / (1 − a (z₀ + z)) + z₀."""
    values = np.random.default_rng(6).lognormal(0.0, 2.0, 40)
    found = mean(values, level=0.9)

    resampled = values[np.random.default_rng(7).integers(0, 40, (200_000, 40))].mean(axis=1)
    z0 = norm.ppf(np.mean(resampled < values.mean()))
    left_out = (values.sum() - values) / 39.0
    u = left_out.mean() - left_out
    a = np.sum(u**3) / (6.0 * np.sum(u**2) ** 1.5)
    z = z0 + norm.ppf([0.05, 0.95])
    low, high = np.quantile(resampled, norm.cdf(z0 + z / (1.0 - a * z)))

    close(found, (float(low), float(high)), 0.04)
    percentile = np.quantile(resampled, [0.05, 0.95])
    assert (np.array([low, high]) - percentile > 0.05 * (high - low)).all()  # they differ


def test_the_median_has_the_interval_of_the_order_statistics() -> None:
    values = np.sort(np.random.default_rng(8).normal(0.0, 1.0, 201))
    found = median(values)
    first = int(binom.ppf(0.025, 201, 0.5))
    assert found.value == values[100]
    assert values[first - 3] <= found.low <= values[first + 3]
    assert values[200 - first - 3] <= found.high <= values[200 - first + 3]


def test_the_ratio_has_fiellers_interval() -> None:
    rng = np.random.default_rng(9)
    b = rng.gamma(16.0, 1.0, 300)
    a = 0.7 * b + rng.gamma(4.0, 0.5, 300)
    found = paired_ratio(a, b)
    (aa, ab), (_, bb) = np.cov(a, b) / 300.0
    # (ā − r b̄)² = z² (s_aa − 2 r s_ab + r² s_bb), solved for r
    z2 = norm.ppf(0.975) ** 2
    roots = np.roots(
        [
            b.mean() ** 2 - z2 * bb,
            -2.0 * (a.mean() * b.mean() - z2 * ab),
            a.mean() ** 2 - z2 * aa,
        ]
    )
    assert found.value == pytest.approx(a.mean() / b.mean())
    close(found, (float(roots.min()), float(roots.max())), 0.04)


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(-100.0, 100.0), min_size=1, max_size=12),
    st.sampled_from([0.25, 2.0, 1024.0]),
)
def test_the_same_values_have_the_same_interval_in_any_unit(
    values: list[float], unit: float
) -> None:
    here, again = mean(values), mean(np.array(values))
    assert here == again
    assert here.low <= here.value <= here.high
    there = mean(unit * np.array(values))
    scale = 1e-9 * unit * (1.0 + np.abs(values).max())
    assert there.low == pytest.approx(unit * here.low, abs=scale)
    assert there.high == pytest.approx(unit * here.high, abs=scale)


def test_a_higher_level_is_wider() -> None:
    values = np.random.default_rng(10).normal(size=30)
    narrow, wide = mean(values, level=0.5), mean(values, level=0.99)
    assert wide.low < narrow.low < narrow.high < wide.high


def test_the_order_of_pairs_does_not_matter_but_who_belongs_to_whom_does() -> None:
    rng = np.random.default_rng(11)
    a = rng.gamma(2.0, 1.0, 200)
    b = a + rng.normal(5.0, 0.1, 200)
    order = rng.permutation(200)
    together, apart = paired_ratio(a, b), paired_ratio(a, b[order])
    close(paired_ratio(a[order], b[order]), (together.low, together.high), 0.05)
    assert apart.high - apart.low > 1.2 * (together.high - together.low)


@pytest.mark.parametrize("statistic", [mean, median])
def test_equal_values_have_no_width_and_one_value_tells_nothing_of_it(statistic) -> None:
    assert statistic([0.7, 0.7]) == Interval(0.7, 0.7, 0.7)
    assert statistic([3.0]) == Interval(3.0, -np.inf, np.inf)


def test_equal_pairs_have_no_width_and_one_pair_tells_nothing_of_it() -> None:
    assert paired_difference([3.0, 4.0], [1.0, 2.0]) == Interval(2.0, 2.0, 2.0)
    assert paired_ratio([3.0, 3.0], [2.0, 2.0]) == Interval(1.5, 1.5, 1.5)
    assert paired_difference([3.0], [1.0]) == Interval(2.0, -np.inf, np.inf)
    assert paired_ratio([3.0], [2.0]) == Interval(1.5, -np.inf, np.inf)


def test_where_the_bca_has_no_answer_the_percentiles_stand() -> None:
    # Whichever value is left out, the median is 0: no acceleration can be had of that.
    values = [0.0] * 6 + [5.0] * 2
    rng = np.random.default_rng(12)
    resampled = np.median(rng.choice(values, (20_000, 8)), axis=1)
    assert np.quantile(resampled, [0.025, 0.975]).tolist() == [0.0, 5.0]
    assert median(values) == Interval(0.0, 0.0, 5.0)


def test_resamples_that_cannot_be_divided_by_reach_to_infinity() -> None:
    assert paired_ratio([1.0, 2.0, 3.0], [0.0, 0.0, 1.0]).high == np.inf
    assert paired_ratio([0.0, 0.0, 3.0], [0.0, 0.0, 1.0]).high == np.inf


@pytest.mark.parametrize("n", [2, 3, 5])
def test_few_values_raise_no_warning(n: int) -> None:
    rng = np.random.default_rng(n)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(10):
            a, b = rng.integers(0, 3, n).astype(float), rng.integers(0, 3, n).astype(float)
            for found in (mean(a), median(a), paired_difference(a, b), paired_ratio(a, b + 1.0)):
                assert found.low <= found.high


@pytest.mark.parametrize("values", [[], [np.nan, 1.0], [1.0, np.inf], [[1.0], [2.0]]])
def test_what_is_no_sample_is_refused(values: object) -> None:
    for statistic in (mean, median):
        with pytest.raises(ConfigError, match="at least one value, all of them finite"):
            statistic(values)


def test_pairs_that_are_none_are_refused() -> None:
    for statistic in (paired_difference, paired_ratio):
        with pytest.raises(ConfigError, match="on either side, got 2 and 3"):
            statistic([1.0, 2.0], [1.0, 2.0, 3.0])
    for a, b in (([1.0, -1.0], [1.0, 1.0]), ([1.0, 1.0], [1.0, -0.1]), ([1.0], [0.0])):
        with pytest.raises(ConfigError, match="values >= 0"):
            paired_ratio(a, b)


def test_many_values_are_drawn_in_parts() -> None:
    values = np.random.default_rng(13).normal(size=5000)
    half = norm.ppf(0.975) * values.std() / np.sqrt(5000)
    close(mean(values), (values.mean() - half, values.mean() + half), 0.03)


def test_holm_by_hand() -> None:
    """0.01 · 4; 0.02 · 3; 0.03 · 2, no less than the one before; 0.04 · 1, likewise."""
    assert holm([0.04, 0.01, 0.03, 0.02]) == pytest.approx([0.06, 0.04, 0.06, 0.06])
    assert holm([0.4, 0.9]).tolist() == [0.8, 0.9]
    assert holm([0.7, 0.6]).tolist() == [1.0, 1.0]
    assert holm([0.03]).tolist() == [0.03]


def test_holm_is_wrong_in_one_of_twenty_families() -> None:
    p = np.random.default_rng(14).random((4000, 6))
    least, most = binom.ppf([1e-5, 1.0 - 1e-5], 4000, 0.05)
    assert sum(holm(family).min() < 0.05 for family in p) <= most
    # 1 − (1 − 0.05 / 6)⁶ = 0.049: nothing is given away where no difference is there.
    assert sum(holm(family).min() < 0.05 for family in p) >= least


def test_the_p_value_of_pairs_is_students() -> None:
    """Differences 1, 2, 3: mean 2, standard error 1 / √3, two degrees of freedom."""
    expected = 2.0 * t.sf(2.0 * np.sqrt(3.0), 2)
    assert paired_p([2.0, 4.0, 6.0], [1.0, 2.0, 3.0]) == pytest.approx(expected)
    assert paired_p([1.0, 2.0, 3.0], [2.0, 4.0, 6.0]) == pytest.approx(expected)


def test_pairs_without_spread_are_the_same_or_not() -> None:
    assert paired_p([1.0, 2.0], [1.0, 2.0]) == 1.0
    assert paired_p([2.0, 3.0], [1.0, 2.0]) == 0.0
    assert paired_p([2.0], [1.0]) == 1.0
    with pytest.raises(ConfigError, match="on either side"):
        paired_p([1.0, 2.0], [1.0])
