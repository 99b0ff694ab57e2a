"""Odometry picked out of a stream of events."""

import numpy as np

from mcloc.events import Event, Odometry, Scan
from mcloc.report.wheels import Wheels


def scan(t: float, odometry: list[float] | None) -> Scan:
    pose = None if odometry is None else np.array(odometry)
    return Scan(t, np.ones(3), np.zeros(3), 10.0, odometry=pose)


def watched(*events: Event) -> Wheels:
    wheels = Wheels()
    assert list(wheels.watch(events)) == list(events)
    return wheels


def test_poses_of_scans_come_before_those_of_odometry() -> None:
    found = watched(Odometry(0.0, np.array([9.0, 9.0, 0.0])), scan(1.0, [1.0, 0.0, 0.0])).trajectory
    assert found is not None
    np.testing.assert_array_equal(found.t, [1.0])
    np.testing.assert_array_equal(found.poses, [[1.0, 0.0, 0.0]])


def test_odometry_where_scans_have_no_poses() -> None:
    found = watched(Odometry(0.5, np.array([1.0, 2.0, 3.0])), scan(1.0, None)).trajectory
    assert found is not None
    np.testing.assert_array_equal(found.t, [0.5])


def test_late_repeated_and_broken_poses_are_left_out() -> None:
    events = [scan(t, [t, 0.0, 0.0]) for t in (1.0, 1.0, 0.5, 2.0)]
    found = watched(*events, scan(3.0, [np.nan, 0.0, 0.0])).trajectory
    assert found is not None
    np.testing.assert_array_equal(found.t, [1.0, 2.0])


def test_nothing_known() -> None:
    assert watched(scan(1.0, None)).trajectory is None
