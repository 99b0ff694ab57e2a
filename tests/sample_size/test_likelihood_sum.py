"""Adaptive sample set sizes of Fox99: the exact index at which the sum of weights passes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcloc.errors import ConfigError
from mcloc.sample_size import LikelihoodSum
from mcloc.statespace import LINE


def stopping_index(log_weights, rule):
    """The first n with Σ p > threshold, limits included, by a plain loop."""
    total = 0.0
    for n, log_weight in enumerate(log_weights, 1):
        total += np.exp(log_weight)
        if n == rule.maximum or (n >= rule.minimum and total > rule.threshold):
            return n
    raise AssertionError("the weights do not suffice")


def feed(rule, log_weights, chunk):
    counter, done = rule.counter(LINE, 0, 0), 0
    while True:
        part = log_weights[done : done + chunk]
        enough = counter.enough(np.zeros((1, len(part))), part)
        if enough is not None:
            return done + enough
        done += chunk


RULES = {
    "threshold": LikelihoodSum(threshold=300.0, minimum=1, maximum=10_000),
    "minimum": LikelihoodSum(threshold=300.0, minimum=5_000, maximum=10_000),
    "maximum": LikelihoodSum(threshold=300.0, minimum=1, maximum=80),
    "exactly": LikelihoodSum(threshold=300.0, minimum=777, maximum=777),
    "first": LikelihoodSum(threshold=1e-9, minimum=1, maximum=10_000),
}


@pytest.mark.parametrize("chunk", [1, 7, 1024, 10_000])
@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
def test_drawing_stops_at_the_exact_index_whatever_the_chunk(rule, chunk):
    log_weights = -np.random.default_rng(1).exponential(2.0, 10_000)
    log_weights[::5] = -np.inf
    assert feed(rule, log_weights, chunk) == stopping_index(log_weights, rule)


@given(
    st.lists(st.floats(-30.0, 0.0) | st.just(-np.inf), min_size=60, max_size=60),
    st.floats(0.01, 40.0),
    st.integers(1, 60),
    st.integers(1, 60),
)
def test_any_weights_in_any_chunks(log_weights, threshold, minimum, chunk):
    rule = LikelihoodSum(threshold=threshold, minimum=minimum, maximum=60)
    assert feed(rule, np.array(log_weights), chunk) == stopping_index(log_weights, rule)


def test_a_surprise_asks_for_as_many_times_more_as_it_is_less_likely():
    rule = LikelihoodSum(threshold=100.0, minimum=1, maximum=10_000)
    expected, surprising = (np.full(10_000, np.log(p)) for p in (0.5, 0.03125))
    assert feed(rule, expected, 512) == 201
    assert feed(rule, surprising, 512) == 3201


def test_without_any_weight_the_set_is_as_large_as_may_be():
    rule = LikelihoodSum(minimum=10, maximum=600)
    assert feed(rule, np.full(1000, -np.inf), 64) == 600


def test_a_maximum_below_the_minimum_is_refused():
    with pytest.raises(ConfigError, match=r"maximum = 20 must be >= minimum = 50"):
        LikelihoodSum(minimum=50, maximum=20)
