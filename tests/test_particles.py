"""Weights are normalized once, −inf is a weight of zero, NaN raises."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcloc.errors import FilterError
from mcloc.particles import Particles, log_sum_exp

LOGS = st.lists(st.floats(-800.0, 800.0) | st.just(-np.inf), min_size=1, max_size=30).filter(
    lambda values: max(values) > -np.inf
)


@given(LOGS, st.floats(-500.0, 500.0))
def test_normalized_weights_sum_to_one_whatever_their_factor(logs, factor):
    log_weights = np.array(logs)
    particles = Particles.normalized(np.zeros((3, len(logs))), log_weights + factor)
    assert particles.weights.sum() == pytest.approx(1.0)
    assert np.exp(particles.log_weights).sum() == pytest.approx(1.0)
    expected = np.exp(log_weights - log_weights.max())
    assert particles.weights == pytest.approx(expected / expected.sum())
    assert 1.0 - 1e-9 <= particles.ess <= len(logs) * (1.0 + 1e-9)


def test_log_sum_exp():
    assert log_sum_exp(np.log([1.0, 2.0, 3.0])) == pytest.approx(np.log(6.0))
    assert log_sum_exp(np.array([-1000.0, -1000.0])) == pytest.approx(-1000.0 + np.log(2.0))
    assert log_sum_exp(np.array([-np.inf, 0.0])) == 0.0
    assert log_sum_exp(np.array([-np.inf, -np.inf])) == -np.inf
    assert log_sum_exp(np.array([])) == -np.inf


def test_ess_of_known_weights():
    states = np.zeros((1, 4))
    assert Particles.equal(states).ess == pytest.approx(4.0)
    one = Particles.normalized(states, np.array([0.0, -np.inf, -np.inf, -np.inf]))
    assert one.ess == pytest.approx(1.0)
    halves = Particles.normalized(states, np.array([5.0, 5.0, -np.inf, -np.inf]))
    assert halves.ess == pytest.approx(2.0)


@pytest.mark.parametrize(
    "log_weights", [[np.nan, 0.0], [-np.inf, -np.inf], [np.inf, 0.0], []], ids=str
)
def test_weights_that_cannot_be_normalized(log_weights):
    with pytest.raises(FilterError, match="weight"):
        Particles.normalized(np.zeros((3, len(log_weights))), np.array(log_weights))


def test_a_set_has_a_particle():
    with pytest.raises(FilterError, match="at least one particle"):
        Particles.equal(np.zeros((3, 0)))


def test_equal_weights():
    particles = Particles.equal(np.zeros((2, 5)))
    assert len(particles) == 5
    assert particles.weights == pytest.approx(0.2)
