"""Patience with those that are behind: paces, with time in hand."""

import math

import pytest

from mcloc.team.patience import FARTHEST, SLOWEST, Patience

WHOLE = 20.0  # s
STEP = 0.25  # s of real time between two heartbeats
EVENT = 0.2  # s of the log between two events


def waited(until, t=1000.0, most=3600.0):
    """s that one at t waits for one that has said until(s) after s seconds, at most so many."""
    patience, s = Patience(WHOLE), 0.0
    patience.see(until(0.0), t)
    while until(s) < t and not patience.over and s < most:
        s += STEP
        patience.spend(STEP)
        patience.see(until(s), t)
    return s


def test_who_does_not_go_on_is_waited_for_as_long_as_patience_lasts():
    assert waited(lambda _: 900.0) == WHOLE
    assert waited(lambda _: -math.inf) == WHOLE


@pytest.mark.parametrize("pace", [1.1 * SLOWEST, 1.0, 30.0])
def test_who_keeps_a_pace_is_waited_for_until_it_comes(pace):
    behind = 300.0
    assert waited(lambda s: 1000.0 - behind + pace * s) == pytest.approx(behind / pace, abs=STEP)


def test_it_may_come_on_in_jumps():
    assert waited(lambda s: 900.0 + 5.0 * (s // 10.0)) == 200.0


def test_who_goes_on_too_slowly_is_not_waited_for_for_ever():
    """Patience lasts for what is wanting of the pace."""
    expected = WHOLE / (1.0 - 0.5)
    assert waited(lambda s: 900.0 + 0.5 * SLOWEST * s) == pytest.approx(expected, abs=2 * STEP)


def test_to_go_on_out_of_reach_earns_nothing():
    assert waited(lambda s: -1e9 + 1e4 * s) == WHOLE
    assert waited(lambda s: 1000.0 - FARTHEST - 1e5 + s) == WHOLE


def test_what_was_gone_on_by_before_earns_nothing_again():
    assert waited(lambda s: 900.0 + s % 10.0) == pytest.approx(WHOLE + 10.0, abs=2 * STEP)


def test_who_holds_each_event_a_little_cannot_slow_others_below_the_pace():
    patience, waited, events = Patience(WHOLE), 0.0, 1000
    for k in range(events):
        t = EVENT * k
        patience.see(math.nextafter(t, -1.0), t)
        while not patience.over:
            patience.spend(STEP)
            waited += STEP
        patience.see(t, t)
    assert waited < WHOLE + events * (EVENT / SLOWEST + STEP)
