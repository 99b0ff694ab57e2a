"""Odometry poses of the recent past, to be read at the stamp of a scan."""

from collections import deque

import numpy as np

from mcloc.events import Odometry
from mcloc.geometry import Pose, interpolate


class OdometryBuffer:
    """The last `size` odometry events, in order of time."""

    def __init__(self, size: int = 1000) -> None:
        self._events: deque[Odometry] = deque(maxlen=size)

    def add(self, event: Odometry) -> str:
        """Take an event in; why it was left out, or nothing."""
        if not (np.isfinite(event.t) and np.isfinite(event.pose).all()):
            return "odometry not finite"
        if self._events and event.t <= self._events[-1].t:
            return "duplicate odometry" if event.t == self._events[-1].t else "late odometry"
        self._events.append(event)
        return ""

    def at(self, t: float, final: bool) -> Pose | None:
        """(3,): the pose at t, between its neighbours; None while the later one is still to come.

        Where none will come (`final`) the last pose holds, and before the first event the first.
        """
        if not self._events or (t > self._events[-1].t and not final):
            return None
        later = None
        for event in reversed(self._events):
            if event.t <= t:
                if later is None:
                    return event.pose
                return interpolate(event.pose, later.pose, (t - event.t) / (later.t - event.t))
            later = event
        return self._events[0].pose
