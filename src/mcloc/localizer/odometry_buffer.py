"""Odometry poses of the recent past, to be read at the stamp of a scan."""

from collections import Counter, deque

import numpy as np

from mcloc.density import FAR
from mcloc.events import Odometry
from mcloc.geometry import Pose, interpolate
from mcloc.localizer.leap_guard import LeapGuard

EXTRAPOLATED = 1.0  # s before the first and after the last event; farther off, nobody knows
INTERPOLATED = 3.0  # s to the nearer neighbour


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
        if (np.abs(event.pose[:2]) >= FAR).any():
            self._ignored["odometry off any map"] += 1
            return
        passed = self.guard.passed(event)
        if passed.wrong is not None:
            self._ignored["odometry stamp from the future"] += 1
        if passed.set_back:
            self._ignored["clock of odometry set back"] += 1
            self.events.clear()
        for e in passed.events:
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

    def reaches(self, t: float) -> bool:
        """Whether events at or after t have come, so that nothing more will be known of it."""
        return bool(self.events) and t <= self.events[-1].t

    def at(self, t: float) -> Pose | None:
        """(3,): the pose at t, between its neighbours; at the ends the first or last pose. None
        where events are too far away from t.
        """
        later = None
        for event in reversed(self.events):
            if event.t <= t:
                if later is None:
                    return event.pose if t - event.t <= EXTRAPOLATED else None
                if min(t - event.t, later.t - t) > INTERPOLATED:
                    return None
                return interpolate(event.pose, later.pose, (t - event.t) / (later.t - event.t))
            later = event
        return later.pose if later is not None and later.t - t <= EXTRAPOLATED else None
