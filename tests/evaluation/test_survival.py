"""Kaplan–Meier of the distance to recovery: tables of the books, Greenwood, edges, properties."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom, norm

from mcloc.errors import ConfigError
from mcloc.evaluation.convergence import Recovery
from mcloc.evaluation.intervals import proportion
from mcloc.evaluation.survival import Survival

# Remission of 21 patients under 6-MP [Freireich and others, Blood 21, 1963]; + is censored.
FREIREICH = "6 6 6 6+ 7 9+ 10 10+ 11+ 13 16 17+ 19+ 20+ 22 23 25+ 32+ 32+ 34+ 35+"


def survival(text: str) -> Survival:
    words = text.split()
    return Survival(
        np.array([float(word.rstrip("+")) for word in words]),
        np.array([not word.endswith("+") for word in words]),
    )


def kaplan_meier(path: np.ndarray, recovered: np.ndarray, d: float) -> tuple[float, float]:
    """S(d), and Greenwood's sum of d / (n (n − d)), event by event."""
    s, greenwood = 1.0, 0.0
    for at in sorted(set(path[recovered].tolist())):
        if at <= d:
            at_risk, found = int((path >= at).sum()), int(((path == at) & recovered).sum())
            s *= 1.0 - found / at_risk
            if at_risk > found:
                greenwood += found / (at_risk * (at_risk - found))
    return s, greenwood


@pytest.mark.parametrize(
    ("at", "s", "low", "high"),
    [  # the table that textbooks and statistics packages print, log-log
        (6.0, 0.857, 0.620, 0.952),
        (7.0, 0.807, 0.563, 0.923),
        (10.0, 0.753, 0.503, 0.889),
        (13.0, 0.690, 0.432, 0.849),
        (16.0, 0.627, 0.368, 0.805),
        (22.0, 0.538, 0.268, 0.747),
        (23.0, 0.448, 0.188, 0.680),
    ],
)
def test_the_table_of_freireich(at: float, s: float, low: float, high: float) -> None:
    for d in (at, at + 0.5):
        found = survival(FREIREICH).within(d)
        assert found.value == pytest.approx(1.0 - s, abs=5e-4)
        assert found.low == pytest.approx(1.0 - high, abs=5e-4)
        assert found.high == pytest.approx(1.0 - low, abs=5e-4)


def test_half_of_freireichs_patients() -> None:
    assert survival(FREIREICH).median == 23.0


def test_a_table_by_hand() -> None:
    # At risk 5: one of five found at 2; of three left after the loss at 3, one at 4; of two, both
    # at 6. S = 4/5, 4/5 · 2/3, 0.
    s = survival("2 3+ 4 6 6")
    assert [s.within(d).value for d in (0.0, 1.99, 2.0, 3.0, 4.0, 5.9, 6.0)] == pytest.approx(
        [0.0, 0.0, 1 / 5, 1 / 5, 7 / 15, 7 / 15, 1.0]
    )
    assert s.median == 6.0
    assert s.restricted_mean(0.0) == 0.0
    assert s.restricted_mean(1.0) == 1.0
    assert s.restricted_mean(3.0) == pytest.approx(2.0 + 4 / 5)
    assert s.restricted_mean(100.0) == pytest.approx(2.0 + 2 * 4 / 5 + 2 * 8 / 15)


def test_who_is_lost_sight_of_where_another_is_found_was_still_at_risk() -> None:
    assert survival("4 4+ 9").within(4.0).value == pytest.approx(1 / 3)


def test_half_is_reached_also_where_the_product_is_rounded_up() -> None:
    at_risk = np.arange(24, 0, -1)
    assert np.cumprod((at_risk - 1) / at_risk)[11] > 0.5
    assert Survival(np.arange(1.0, 25.0), np.arange(24) < 12).median == 12.0


def test_there_is_no_median_where_most_are_not_found() -> None:
    assert survival("1 2+ 3+").median is None


def test_the_interval_is_greenwoods_exponential_one() -> None:
    rng = np.random.default_rng(1)
    true, end = rng.exponential(20.0, 80).round(1), rng.uniform(5.0, 60.0, 80).round(1)
    path, recovered = np.minimum(true, end), true <= end
    for d in (3.0, 10.0, 25.0, 40.0):
        s, greenwood = kaplan_meier(path, recovered, d)
        found = Survival(path, recovered).within(d, level=0.9)
        spread = norm.ppf(0.95) * np.sqrt(greenwood) / abs(np.log(s))
        assert found.value == pytest.approx(1.0 - s)
        assert found.low == pytest.approx(1.0 - s ** np.exp(-spread))
        assert found.high == pytest.approx(1.0 - s ** np.exp(spread))


def test_nobody_found_yet_says_as_much_as_the_robots_that_drove_so_far() -> None:
    s = survival("4+ 6+ 8 8+ 9+")
    for d, drove in ((0.0, 5), (4.0, 5), (5.0, 4), (6.0, 4), (7.9, 3)):
        assert s.within(d) == proportion(0, drove)


def test_everybody_found_says_as_much_as_that_many_robots() -> None:
    assert survival("1 2 5").within(5.0) == proportion(3, 3)
    assert survival("0 0 0").within(0.0) == proportion(3, 3)


def test_the_last_one_found_does_not_vouch_for_those_out_of_sight() -> None:
    found = survival("1 2+ 3+ 5").within(5.0)
    assert (found.value, found.high) == (1.0, 1.0)
    assert found.low == proportion(2, 4).low


def test_farther_than_any_robot_drove_nothing_bounds_the_share_from_above() -> None:
    s = survival("1 2 4+ 5+")
    assert s.within(5.0).high < 1.0
    beyond = s.within(5.1)
    assert (beyond.value, beyond.low, beyond.high) == (0.5, s.within(5.0).low, 1.0)
    never = survival("4+ 5+").within(6.0)
    assert (never.value, never.low, never.high) == (0.0, 0.0, 1.0)
    assert s.within(np.inf).high == 1.0


@pytest.mark.parametrize("d", [2.0, 12.0, 35.0])
def test_shares_are_covered_though_robots_go_out_of_sight(d: float) -> None:
    """95 % of 400 studies; outside these bounds once in 100,000 suites on either side. Near the
    edges the exact limits cover more than they must."""
    rng = np.random.default_rng(2)
    truth = 1.0 - np.exp(-d / 15.0)
    inside = 0
    for _ in range(400):
        true, end = rng.exponential(15.0, 60), rng.uniform(15.0, 60.0, 60)
        found = Survival(np.minimum(true, end), true <= end).within(d)
        inside += found.low <= truth <= found.high
    least, most = binom.ppf([1e-5, 1.0 - 1e-5], 400, 0.95)
    assert least <= inside <= most


def test_at_the_edges_shares_are_covered_at_least_as_often_as_stated() -> None:
    rng = np.random.default_rng(3)
    for d, edge in ((0.4, 0.0), (60.0, 1.0)):
        truth, inside, at_edge = 1.0 - np.exp(-d / 10.0), 0, 0
        for _ in range(400):
            true, end = rng.exponential(10.0, 8), rng.uniform(0.1, 300.0, 8)
            found = Survival(np.minimum(true, end), true <= end).within(d)
            inside += found.low <= truth <= found.high
            at_edge += found.value == edge
        assert at_edge > 100
        assert inside >= binom.ppf(1e-5, 400, 0.95)


@st.composite
def studies(draw: st.DrawFn, censored: bool = True) -> Survival:
    n = draw(st.integers(1, 15))
    tenths = st.integers(0, 40).map(lambda k: k / 4.0)  # ties are likely
    path = draw(st.lists(tenths, min_size=n, max_size=n))
    seen = st.booleans() if censored else st.just(True)
    return Survival(np.array(path), np.array(draw(st.lists(seen, min_size=n, max_size=n))))


@settings(max_examples=50, deadline=None)
@given(studies())
def test_the_share_found_only_grows_and_lies_in_its_interval(s: Survival) -> None:
    found = [s.within(d) for d in np.arange(0.0, 12.0, 0.5)]
    values = np.array([interval.value for interval in found])
    assert (np.diff(values) >= 0.0).all()
    for interval in found:
        assert 0.0 <= interval.low <= interval.value + 1e-12
        assert interval.value - 1e-12 <= interval.high <= 1.0


@settings(max_examples=100, deadline=None)
@given(studies())
def test_it_is_the_product_over_the_events(s: Survival) -> None:
    for d in (0.0, 2.0, 4.9, 7.5, 10.0):
        assert s.within(d).value == pytest.approx(
            1.0 - kaplan_meier(s.path, s.recovered, d)[0], abs=1e-12
        )


@settings(max_examples=100, deadline=None)
@given(studies(censored=False))
def test_without_censoring_it_is_the_share_itself(s: Survival) -> None:
    for d in (0.0, 2.0, 5.1, 10.0):
        assert s.within(d).value == pytest.approx(np.mean(s.path <= d), abs=1e-12)
        assert s.restricted_mean(d) == pytest.approx(np.minimum(s.path, d).mean(), abs=1e-12)
    assert s.median == np.quantile(s.path, 0.5, method="inverted_cdf")


@settings(max_examples=50, deadline=None)
@given(studies(), st.randoms())
def test_neither_the_order_nor_the_unit_matters(s: Survival, random) -> None:
    order = list(range(len(s)))
    random.shuffle(order)
    other = Survival(4.0 * s.path[order], s.recovered[order])
    assert other.within(20.0) == s.within(5.0)
    assert other.median == (None if s.median is None else 4.0 * s.median)
    assert other.restricted_mean(24.0) == pytest.approx(4.0 * s.restricted_mean(6.0))


@settings(max_examples=50, deadline=None)
@given(studies(), st.floats(0.0, 15.0))
def test_the_restricted_mean_is_the_area_under_s(s: Survival, limit: float) -> None:
    cells = (np.arange(6000) + 0.5) / 6000 * limit
    s_of = {d: 1.0 - s.within(d).value for d in np.arange(0.0, 15.1, 0.25).tolist()}
    area = np.mean([s_of[np.floor(4.0 * d) / 4.0] for d in cells.tolist()]) * limit
    assert s.restricted_mean(limit) == pytest.approx(area, abs=60 * limit / 6000)


def recovery(path_m: float, after_m: float | None = None) -> Recovery:
    after_s = None if after_m is None else 2.0 * after_m
    return Recovery(0.0, after_m is not None, path_m, after_s, after_m)


def test_stretches_become_paths_and_short_ones_are_left_out() -> None:
    s = Survival.of([recovery(40.0, 3.0), recovery(14.9, 1.0), recovery(15.0 - 1e-9), recovery(20)])
    assert s.path.tolist() == [3.0, pytest.approx(15.0), 20.0]
    assert s.recovered.tolist() == [True, False, False]
    assert len(s) == 3
    assert len(Survival.of(iter([recovery(2.0), recovery(9.0, 0.0)]), least_path=0.0)) == 2


def test_no_stretch_that_is_long_enough_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"no stretch is 15 m long: .* lower least_path"):
        Survival.of([recovery(14.0, 2.0)])


@pytest.mark.parametrize(
    ("path", "recovered"),
    [([], []), ([1.0], [True, False]), ([[1.0]], [[True]]), ([-1.0], [True]), ([np.nan], [True])],
)
def test_what_are_no_paths_is_refused(path: list[float], recovered: list[bool]) -> None:
    with pytest.raises(ConfigError, match="path"):
        Survival(np.array(path), np.array(recovered))


def test_what_is_no_distance_is_refused() -> None:
    s = survival("1 2+")
    for bad in (-0.1, np.nan):
        with pytest.raises(ConfigError, match="metres >= 0"):
            s.within(bad)
        with pytest.raises(ConfigError, match="metres >= 0"):
            s.restricted_mean(bad)
    with pytest.raises(ConfigError, match="finite"):
        s.restricted_mean(np.inf)
