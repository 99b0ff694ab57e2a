"""Odometry poses read at the stamp of a scan."""

from collections import Counter

import numpy as np
import pytest

from mcloc.events import Odometry
from mcloc.localizer.odometry_buffer import OdometryBuffer


def filled(*events, size=1000):
    buffer = OdometryBuffer(Counter(), size)
    for t, *pose in events:
        buffer.add(Odometry(t, np.array(pose)))
    assert not buffer._ignored
    return buffer


def test_interpolates_between_neighbours_the_short_way_around():
    buffer = filled((1.0, 0.0, 0.0, 3.0), (2.0, 4.0, 2.0, -3.0), (3.0, 5.0, 2.0, -3.0))
    at = buffer.at(1.25)
    assert at[:2] == pytest.approx([1.0, 0.5])
    assert at[2] == pytest.approx(3.0 + 0.25 * (2.0 * np.pi - 6.0))
    assert buffer.at(2.5) == pytest.approx([4.5, 2.0, -3.0])


def test_a_stamp_of_its_own_is_read_as_it_is():
    buffer = filled((1.0, 1.0, 2.0, 0.5), (2.0, 4.0, 2.0, 0.7))
    assert buffer.at(1.0).tolist() == [1.0, 2.0, 0.5]
    assert buffer.at(2.0).tolist() == [4.0, 2.0, 0.7]


def test_reaches_a_stamp_once_events_at_or_after_it_have_come():
    buffer = filled((1.0, 1.0, 2.0, 0.5))
    assert not OdometryBuffer(Counter()).reaches(0.0)
    assert buffer.reaches(1.0)
    assert not buffer.reaches(1.5)


def test_at_the_ends_the_first_and_the_last_hold_for_a_second():
    buffer = filled((1.0, 1.0, 2.0, 0.5), (2.0, 4.0, 2.0, 0.7))
    assert buffer.at(0.0).tolist() == [1.0, 2.0, 0.5]
    assert buffer.at(-0.1) is None
    assert buffer.at(3.0).tolist() == [4.0, 2.0, 0.7]
    assert buffer.at(3.1) is None


def test_in_the_middle_of_a_long_gap_nobody_knows():
    buffer = filled((1.0, 0.0, 0.0, 0.0), (9.0, 8.0, 0.0, 0.0))
    assert buffer.at(4.0) == pytest.approx([3.0, 0.0, 0.0])
    assert buffer.at(4.5) is None
    assert buffer.at(6.0) == pytest.approx([5.0, 0.0, 0.0])


def test_nothing_is_known_without_odometry():
    assert OdometryBuffer(Counter()).at(0.0) is None


def test_what_is_left_out_and_why():
    buffer = filled((1.0, 0.0, 0.0, 0.0), (2.0, 1.0, 0.0, 0.0))
    zero = np.zeros(3)
    far, infinite = np.array([1e7, 0.0, 0.0]), np.array([0.0, np.inf, 0.0])
    for t, pose in ((2.0, zero), (1.5, zero), (np.nan, zero), (3.0, infinite), (3.0, far)):
        buffer.add(Odometry(t, pose))
    assert buffer._ignored == {
        "duplicate odometry": 1,
        "late odometry": 1,
        "odometry not finite": 2,
        "odometry off any map": 1,
    }
    assert buffer.at(2.0).tolist() == [1.0, 0.0, 0.0]


def test_keeps_the_last_events_only():
    buffer = filled(*((float(t), float(t), 0.0, 0.0) for t in range(10)), size=4)
    assert buffer.at(7.5) == pytest.approx([7.5, 0.0, 0.0])
    assert buffer.at(5.5) == pytest.approx([6.0, 0.0, 0.0])


def test_a_stamp_from_the_future_makes_nothing_late():
    buffer = filled((1.0, 0.0, 0.0, 0.0), (1.1, 1.0, 0.0, 0.0))
    for t in (5000.0, 1.2, 1.3):
        buffer.add(Odometry(t, np.full(3, t / 1e4)))
    assert buffer._ignored == {"odometry stamp from the future": 1}
    assert buffer.at(1.3) == pytest.approx([1.3e-4] * 3)


def test_after_a_pause_the_second_event_confirms_the_first():
    buffer = filled((1.0, 0.0, 0.0, 0.0))
    buffer.add(Odometry(500.0, np.full(3, 0.5)))
    assert not buffer.reaches(400.0)
    buffer.add(Odometry(500.1, np.full(3, 0.6)))
    assert not buffer._ignored
    assert buffer.at(500.0) == pytest.approx([0.5] * 3)


def test_at_the_end_nothing_contradicts_the_last_stamp():
    buffer = filled((1.0, 0.0, 0.0, 0.0))
    buffer.add(Odometry(500.0, np.full(3, 0.5)))
    buffer.finish()
    assert buffer.at(500.0) == pytest.approx([0.5] * 3)


def test_a_clock_that_is_set_back_starts_anew():
    """Three stamps in a row far behind: the first was wrong, or the clock is."""
    buffer = filled((3601.0, 9.0, 9.0, 0.0))
    for t in (1.0, 1.1, 1.2, 1.3):
        buffer.add(Odometry(t, np.full(3, t)))
    assert buffer._ignored == {"late odometry": 2, "clock of odometry set back": 1}
    assert [e.t for e in buffer.events] == [1.2, 1.3]
