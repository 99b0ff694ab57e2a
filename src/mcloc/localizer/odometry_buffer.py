"""Odometry poses of the recent past, to be read at the stamp of a scan."""

from collections import Counter, deque

import numpy as np

from mcloc.events import Odometry
from mcloc.geometry import Pose, interpolate
from mcloc.localizer.leap_guard import LeapGuard


class OdometryBuffer:
    """The last `size` odometry events, in order of time. ignored: counts, by reason, what is left
    out.
    """

    def __init__(self, ignored: Counter[str], size: int = 1000) -> None:
        self.events: deque[Odometry] = deque(maxlen=size)
        self.guard: LeapGuard[Odometry] = LeapGuard()
        self._ignored = ignored

    def add(self, event: Odometry) -> None:
        """Take an event in, unless its stamp or pose cannot be right."""
        if not (np.isfinite(event.t) and np.isfinite(event.pose).all()):
            self._ignored["odometry not finite"] += 1
            return
        passed, wrong = self.guard.passed(event)
        if wrong is not None:
            self._ignored["odometry stamp from the future"] += 1
        for e in passed:
            self._append(e)

    def finish(self) -> None:
        """Nothing will come any more."""
        for event in self.guard.rest():
            self._append(event)

    def _append(self, event: Odometry) -> None:
        if self.events and event.t <= self.events[-1].t:
            late = event.t < self.events[-1].t
            self._ignored["late odometry" if late else "duplicate odometry"] += 1
        else:
            self.events.append(event)

    def at(self, t: float, final: bool) -> Pose | None:
        """(3,): the pose at t, between its neighbours; None while the later one is still to come.

        Where none will come (`final`) the last pose holds, and before the first event the first.
        """
        if not self.events or (t > self.events[-1].t and not final):
            return None
        later = None
        for event in reversed(self.events):
            if event.t <= t:
                if later is None:
                    return event.pose
                return interpolate(event.pose, later.pose, (t - event.t) / (later.t - event.t))
            later = event
        return self.events[0].pose
