"""Reading ahead: no detection comes before the stamp that was told."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcloc.events import Detection, Odometry
from mcloc.team.look_ahead import HORIZON, LookAhead


def odometry(t):
    return Odometry(t, np.zeros(3))


def detection(t):
    return Detection(t, "b", 1.0, 0.0)


def log(n, every, seed=1):
    """n odometry events, on average one of `every` followed by a detection."""
    rng = np.random.default_rng(seed)
    for t in np.cumsum(rng.exponential(0.2, n)):
        yield odometry(t)
        if rng.random() < 1.0 / every:
            yield detection(t + 0.001)


@pytest.mark.parametrize("every", [2, 50, 5000])
def test_events_come_in_order_and_detections_not_before_they_were_told(every):
    expected, ahead, came, told = list(log(3000, every)), LookAhead(log(3000, every)), [], []
    while ahead.next is not None:
        told.append(ahead.until)
        assert ahead.next.t <= ahead.until or ahead.until == math.inf
        came.append(ahead.pop())
    assert [(type(e), e.t) for e in came] == [(type(e), e.t) for e in expected]
    stamps = [e.t if isinstance(e, Detection) else math.inf for e in came]
    later = np.minimum.accumulate(stamps[::-1])[::-1]
    assert (np.array(told) <= later).all()
    assert ahead.until == math.inf


def test_it_begins_anew():
    expected, ahead = list(log(300, 50)), LookAhead(list(log(300, 50)))
    for some in (200, 300, 10):
        for _ in range(some):
            ahead.pop()
        ahead.rewind()
    assert ahead.until < expected[-1].t
    assert [ahead.pop().t for _ in expected] == [e.t for e in expected]
    assert ahead.next is None


def test_it_is_told_some_seconds_ahead():
    ahead = LookAhead(log(3000, 5000))
    for _ in range(1000):
        assert ahead.until > ahead.next.t + 0.25 * HORIZON
        ahead.pop()


def test_wheels_come_out_of_turn_and_once():
    events = [detection(0.0), odometry(0.1), detection(0.2), odometry(0.3)]
    ahead = LookAhead(iter(events))
    assert [ahead.pop_wheels().t for _ in range(2)] == [0.1, 0.3]
    assert ahead.pop_wheels() is None
    assert [ahead.pop().t for _ in range(2)] == [0.0, 0.2]
    assert ahead.next is None


def test_the_first_detection_is_told_until_it_is_done_with():
    ahead = LookAhead(iter([odometry(0.0), detection(1.0), odometry(2.0), detection(3.0)]))
    told = []
    while ahead.next is not None:
        told.append(ahead.until)
        ahead.pop()
    assert told == [1.0, 1.0, 3.0, 3.0]


def test_the_stamp_of_the_next_event_is_that_of_the_one_after_it_where_it_cannot_be():
    stamps = [0.0, 1.0, 1e6, math.nan, 2.0, 1.9, 1e6, 3.0, 500.0, 501.0]
    ahead, told = LookAhead([odometry(t) for t in stamps]), []
    while ahead.next is not None:
        told.append(ahead.stamp)
        ahead.pop()
    assert told == [0.0, 1.0, 2.0, 2.0, 2.0, 1.9, 3.0, 3.0, 500.0, 501.0]


@given(st.lists(st.tuples(st.booleans(), st.floats(allow_nan=True)), max_size=60))
def test_whatever_the_stamps_all_events_come(spoilt):
    events = [(detection if seen else odometry)(t) for seen, t in spoilt]
    ahead, came = LookAhead(iter(events)), []
    while ahead.next is not None:
        assert not math.isnan(ahead.until)
        came.append(ahead.pop())
    assert came == events


def test_one_wrong_stamp_does_not_hide_detections():
    events = [odometry(0.1 * k) for k in range(500)]
    events[5] = odometry(1e6)
    ahead = LookAhead(iter([*events, detection(60.0)]))
    while ahead.next is not None:
        assert ahead.until <= 60.0 or ahead.until == math.inf
        event = ahead.pop()
    assert event.t == 60.0
