"""Measurements that wait for their odometry, and for what other sensors may still bring."""

from bisect import insort
from collections import Counter, defaultdict
from collections.abc import Iterator

import numpy as np

from mcloc.density import FAR
from mcloc.events import Measurement
from mcloc.geometry import Pose
from mcloc.localizer.leap_guard import LEAP, LeapGuard
from mcloc.localizer.odometry_buffer import OdometryBuffer

MOST = 1000  # measurements without odometry
LATENCY = 1.0  # s that a measurement of one sensor waits for those of another


class Queue:
    """Measurements in order of time, each with the wheels' pose at its stamp.

    ignored: counts, by reason, what is left out. wheels: their poses. done: seconds, the stamp of
    the last measurement that was processed; what is older comes too late.
    """

    def __init__(self, ignored: Counter[str]) -> None:
        self.wheels = OdometryBuffer(ignored)
        self.guard: LeapGuard[Measurement] = LeapGuard()
        self.waiting: list[Measurement] = []
        self.newest: defaultdict[str, float] = defaultdict(lambda: -np.inf)  # by sensor, s
        self.done = -np.inf
        self._ignored = ignored

    @property
    def late_before(self) -> float:
        """Seconds: what has an earlier stamp comes too late; −inf where the wheels' clock was set
        back.
        """
        set_back = -np.inf < self.wheels.guard.newest < self.done - LEAP
        return -np.inf if set_back else self.done

    def add(self, z: Measurement) -> bool:
        """Let a measurement wait for its turn, unless it is of no use, comes twice or too late.
        True where the clock of its sensor was set back.
        """
        reason = _broken(z)
        if reason:
            self._ignored[reason] += 1
            return False
        passed = self.guard.passed(z)
        if passed.wrong is not None:
            self._ignored[f"{z.called} stamp from the future"] += 1
        if passed.set_back:
            self._ignored[f"clock of {z.called}s set back"] += 1
            self.waiting.clear()
            self.newest.clear()
            self.done = -np.inf
        for measurement in passed.events:
            self._insert(measurement)
        return passed.set_back

    def finish(self) -> None:
        """Nothing will come any more."""
        self.wheels.finish()
        self._confirm()

    def hasten(self, t: float) -> None:
        """Believe the stamp of a last measurement up to t, now that the wheels have come there."""
        held = self.guard.held
        if held is not None and held.t <= t and self.wheels.reaches(held.t):
            self._confirm()

    def ready(self, final: bool, until: float) -> Iterator[tuple[Measurement, Pose]]:
        """Those whose odometry is known by now, and (3,) the wheels' pose; up to `until` without
        regard to what other sensors may bring. final: all, with the last odometry there is.
        """
        while self.waiting:
            z = self.waiting[0]
            if not (final or self._due(z) or (z.t <= until and self._known(z))):
                break
            self.waiting.pop(0)
            at = z.odometry if z.odometry is not None else self.wheels.at(z.t)
            if at is None:
                self._ignored[f"{z.called} without odometry"] += 1
            else:
                yield z, at

    def _confirm(self) -> None:
        for measurement in self.guard.rest():
            self._insert(measurement)

    def _insert(self, z: Measurement) -> None:
        newest = self.newest[z.source]
        if z.t == newest:
            self._ignored[f"duplicate {z.called}"] += 1
            return
        self.newest[z.source] = max(z.t, newest)
        if z.t < max(self.done, newest):
            self._ignored[f"late {z.called}"] += 1
            return
        insort(self.waiting, z, key=lambda waiting: waiting.t)
        if len(self.waiting) > MOST:
            gone = self.waiting.pop(0)
            self._ignored[f"{gone.called} without odometry"] += 1

    def _due(self, z: Measurement) -> bool:
        """Whether its odometry is known, and no other sensor may still bring something older."""
        if not self._known(z):
            return False
        newest = max(*self.newest.values(), self.wheels.guard.newest)
        return newest - z.t > LATENCY or not any(
            z.t - LATENCY < t < z.t for t in self.newest.values()
        )

    def _known(self, z: Measurement) -> bool:
        """Whether its odometry is."""
        return z.odometry is not None or self.wheels.reaches(z.t)


def _broken(z: Measurement) -> str:
    """Why a measurement can be of no use, or nothing."""
    if not np.isfinite(z.t):
        return f"{z.called} stamp not finite"
    if z.odometry is not None and not np.isfinite(z.odometry).all():
        return "odometry not finite"
    if z.odometry is not None and (np.abs(z.odometry[:2]) >= FAR).any():
        return "odometry off any map"
    return "" if z.useful else z.empty
