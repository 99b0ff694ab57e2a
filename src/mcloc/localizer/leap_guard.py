"""Stamps that cannot be: a wrong one must not make everything after it late."""

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from mcloc.events import Measurement, Odometry

LEAP = 10.0  # s
CONVINCED = 3  # events in a row: then the clock has been set back

E = TypeVar("E", bound=Odometry | Measurement)


def believed(t: float, following: float) -> float:
    """s: the stamp of an event, or where it leaps ahead of that of the one after it, that one's."""
    return following if t - following > LEAP else t


@dataclass(frozen=True, slots=True)
class Passed(Generic[E]):
    """The events that may pass now, in the order in which they came; the one that proved wrong;
    whether the clock was set back, so that stamps start anew with these events.
    """

    events: list[E]
    wrong: E | None = None
    set_back: bool = False


class LeapGuard(Generic[E]):
    """Judges stamps by their neighbours.

    An event whose stamp leaps ahead is held until the next one tells whether the clock did: a log
    may pause, then the next event leaps as well, and both pass; otherwise the stamp was wrong.
    Where several events in a row lie far behind the newest, that was the wrong one, or somebody set
    the clock back.
    """

    def __init__(self) -> None:
        self.newest = -np.inf
        self.behind = 0  # events in a row
        self.held: E | None = None

    def passed(self, event: E) -> Passed[E]:
        """What may pass, now that this event has come."""
        held, self.held = self.held, None
        ahead = event.t - self.newest
        if ahead < -LEAP and held is None:
            self.behind += 1
            if self.behind < CONVINCED:
                return Passed([event])
            self.newest, self.behind = event.t, 0
            return Passed([event], set_back=True)
        self.behind = 0
        leaps = ahead > LEAP and self.newest > -np.inf
        if held is None and leaps:
            self.held = event
            return Passed([])
        self.newest = max(self.newest, event.t)
        if held is None:
            return Passed([event])
        return Passed([held, event]) if leaps else Passed([event], wrong=held)

    def rest(self) -> list[E]:
        """The event that is still held: the stream ends, nothing will contradict it."""
        held, self.held = self.held, None
        return [] if held is None else [held]
