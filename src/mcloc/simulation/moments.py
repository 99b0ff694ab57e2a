"""The moments of a recorded log: scans whose place the truth knows, and the path from each to the
next.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import LogError, TruthError
from mcloc.evaluation.errors import STAMP_TOLERANCE
from mcloc.events import Event, Odometry, Scan
from mcloc.geometry import Pose
from mcloc.trajectory import Trajectory

NEAR = 0.5  # s: a scan with a reference so near has a known place
GAP = 3.0  # m: nobody knows which way led from one reference to one so far from it


@dataclass(frozen=True)
class Stretch:
    """From moment `first` to moment `last` of the log."""

    first: int
    last: int


class Recording:
    """What a log and its truth say of its moments.

    scans: (M,) index in `events` of each moment. path: (M,) metres of true path from the first one.
    places: (M, 2) where they are.
    """

    def __init__(self, events: list[Event], truth: Trajectory) -> None:
        self.events, self.truth = events, truth
        self.t = np.array([event.t for event in events])
        scans = np.array([k for k, event in enumerate(events) if isinstance(event, Scan)], np.intp)
        if len(scans) == 0:
            raise LogError("the log holds no scans: nobody can be localized with it")
        self.scans = scans[_covered(self.t[scans], truth)]
        if len(self.scans) == 0:
            raise TruthError(
                f"no scan has a reference within {NEAR:g} s: {_span(self.t[scans])} (scans), "
                f"{_span(truth.t)} (truth); both must carry the stamps of the same clock"
            )
        moments = self.t[self.scans]
        step = np.hypot(*np.diff(truth.poses[:, :2], axis=0).T)
        way = np.append(0.0, np.cumsum(np.where(step > GAP, 0.0, step)))
        path = np.interp(moments, truth.t, way)
        self.path = path - path[0]
        if self.path[-1] == 0.0:
            raise TruthError("the truth does not move along the log: there is no path to drive")
        self.places = truth.at(moments)[:, :2]

    @cached_property
    def scan_interval(self) -> float:
        """The median time from one scan of a laser to its next one, in seconds."""
        stamps: dict[str, list[float]] = {}
        for event in self.events:
            if isinstance(event, Scan):
                stamps.setdefault(event.source, []).append(event.t)
        between = np.concatenate([np.diff(t) for t in stamps.values()])
        between = between[between > 0.0]  # coarse stamps are often the same
        if len(between) == 0:
            raise LogError("no laser has two scans: the log is too short for a kidnapping")
        return float(np.median(between))

    @cached_property
    def interpolated(self) -> bool:
        """Whether scans are without an odometry pose of their own."""
        return any(isinstance(event, Scan) and event.odometry is None for event in self.events)

    @cached_property
    def wheels(self) -> Trajectory:
        """What the Odometry events say; the first of several with one stamp."""
        events = [event for event in self.events if isinstance(event, Odometry)]
        if not events:
            raise LogError("the log holds no odometry: nobody can be localized with it")
        t, first = np.unique([event.t for event in events], return_index=True)
        return Trajectory(t, np.array([events[k].pose for k in first]))

    def scan(self, moment: int) -> Scan:
        event = self.events[self.scans[moment]]
        assert isinstance(event, Scan)
        return event

    def odometry(self, moment: int) -> Pose:
        """(3,): of the log, at a moment."""
        scan = self.scan(moment)
        at: Pose = self.wheels.at(np.array([scan.t]))[0] if scan.odometry is None else scan.odometry
        return at

    def within(self, stretch: Stretch) -> list[Event]:
        """The events from its first scan to its last. Where the odometry of scans has to be
        interpolated, it is told at both, or the way to the next stretch would be part of it.
        """
        events = self.events[self.scans[stretch.first] : self.scans[stretch.last] + 1]
        if self.interpolated:
            for moment, place in ((stretch.last, len(events) - 1), (stretch.first, 0)):
                t = self.scan(moment).t
                if not any(isinstance(event, Odometry) and event.t == t for event in events):
                    events.insert(place, Odometry(t, self.odometry(moment)))
        return events


def _covered(t: NDArray[np.float64], truth: Trajectory) -> NDArray[np.bool_]:
    """Which stamps lie within the truth, near a reference and in no gap."""
    if len(truth) == 0:
        return np.zeros(len(t), dtype=np.bool_)
    tolerance = STAMP_TOLERANCE
    after = np.minimum(np.searchsorted(truth.t, t), len(truth) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.minimum(np.abs(truth.t[after] - t), np.abs(t - truth.t[before]))
    within = (t >= truth.t[0] - tolerance) & (t <= truth.t[-1] + tolerance)
    step = truth.poses[after, :2] - truth.poses[before, :2]
    known = (np.hypot(step[:, 0], step[:, 1]) <= GAP) | (nearest <= tolerance)
    covered: NDArray[np.bool_] = within & known & (nearest <= NEAR)
    return covered


def _span(t: NDArray[np.float64]) -> str:
    return f"t = {t[0]:.3f} … {t[-1]:.3f} s" if len(t) else "nothing"
