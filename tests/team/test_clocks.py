"""Offsets of clocks: the interval holds the truth, whatever the delays."""

import math

import numpy as np
import pytest

from mcloc.team.clocks import KEPT, ClockOffset


@pytest.mark.parametrize("seed", range(20))
def test_the_truth_lies_within_whatever_the_delays(seed):
    rng = np.random.default_rng(seed)
    truth, offset = rng.uniform(-2.0, 2.0), ClockOffset()
    for now in np.arange(1.0, 50.0, 0.5):
        out, held, back = rng.exponential([0.1, 0.3, 0.1])
        asked = now - out - held - back
        sent = asked + out + held + truth  # by the other clock
        offset.note(sent - now, sent - asked - held, now)
        assert offset.low <= truth <= offset.high
    assert offset.known
    assert offset.high - offset.low < 0.1  # of a hundred round trips of 0.2 s the fastest two


def test_one_way_only_one_end_is_known():
    offset = ClockOffset()
    offset.note(0.7, math.inf, 1.0)
    assert not offset.known
    assert math.isnan(offset.middle)
    assert offset.beyond(0.5) == "ahead"
    assert offset.beyond(0.8) == ""


def test_a_clock_is_beyond_a_bound_where_all_of_the_interval_is():
    offset = ClockOffset()
    offset.note(-0.9, -0.6, 1.0)
    assert offset.beyond(0.5) == "behind"
    assert offset.beyond(0.7) == ""
    assert offset.middle == pytest.approx(-0.75)


def test_a_clock_that_is_set_is_followed():
    offset = ClockOffset()
    offset.note(-0.01, 0.01, 1.0)
    offset.note(2.99, 3.01, 2.0)
    assert offset.middle == pytest.approx(3.0)


def test_an_old_interval_makes_way_for_a_wider_one_with_both_ends():
    offset = ClockOffset()
    offset.note(-0.01, 0.01, 1.0)
    offset.note(-0.1, 0.2, 2.0)
    assert (offset.low, offset.high) == (-0.01, 0.01)
    offset.note(-0.1, math.inf, 2.0 + KEPT)
    assert (offset.low, offset.high) == (-0.01, 0.01)
    offset.note(-0.1, 0.2, 2.0 + KEPT)
    assert (offset.low, offset.high) == (-0.1, 0.2)


def test_an_answer_before_the_question_teaches_nothing():
    offset = ClockOffset()
    offset.note(0.5, 0.1, 1.0)
    assert not offset.known
