"""Stamps from the future: one wrong stamp must not make everything after it late."""

from typing import Generic, TypeVar

import numpy as np

from mcloc.events import Odometry, Scan

LEAP = 10.0  # s

E = TypeVar("E", Odometry, Scan)


class LeapGuard(Generic[E]):
    """Holds an event whose stamp leaps ahead until the next one tells whether the clock did.

    A log may pause; then the next event leaps as well, and both pass. Otherwise the stamp was
    wrong.
    """

    def __init__(self) -> None:
        self.newest = -np.inf
        self.held: E | None = None

    def passed(self, event: E) -> tuple[list[E], E | None]:
        """The events that may pass now, in the order in which they came, and the one that proved
        wrong.
        """
        held, self.held = self.held, None
        leaps = event.t - self.newest > LEAP and self.newest > -np.inf
        if held is None and leaps:
            self.held = event
            return [], None
        self.newest = max(self.newest, event.t)
        if held is None:
            return [event], None
        return ([held, event], None) if leaps else ([event], held)

    def rest(self) -> list[E]:
        """The event that is still held: the stream ends, nothing will contradict it."""
        held, self.held = self.held, None
        return [] if held is None else [held]
