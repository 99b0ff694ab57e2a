"""A log, read a little ahead of what is processed: so a robot that replays it knows before which
stamp it will not see another one, and where its wheels will be.
"""

import math
from collections import deque
from collections.abc import Iterable
from itertools import islice

from mcloc.events import Detection, Event, Odometry
from mcloc.localizer.leap_guard import believed

HORIZON = 10.0  # s
MOST_READ = 20_000  # events at once: stamps may stand still


class LookAhead:
    """Events in the order of the log. until: s, the stamp before which no detection comes any more,
    as far as the log is in order; ∞ when none will.
    """

    def __init__(self, log: Iterable[Event | Detection]) -> None:
        self._log = log
        self.rewind()

    def rewind(self) -> None:
        """Begin anew, where the log can be gone through again."""
        self._events = iter(self._log)
        self._held: deque[Event | Detection] = deque()
        self._ended = False
        self._stamps = deque([-math.inf, -math.inf], maxlen=2)
        self._low = 0  # events: then more are read
        self._fill()

    @property
    def next(self) -> Event | Detection | None:
        """The event whose turn it is; None at the end."""
        return self._held[0] if self._held else None

    @property
    def stamp(self) -> float:
        """s: when the next event was, by its stamp, or by that of the one after it where its own
        cannot be; NaN where nothing tells.
        """
        stamps = list(islice((e.t for e in self._held if math.isfinite(e.t)), 2))
        return believed(stamps[0], stamps[-1]) if stamps else math.nan

    def pop(self) -> Event | Detection:
        """The next event, which is then done with."""
        event = self._held.popleft()
        self._look(event)
        return event

    def pop_wheels(self) -> Odometry | None:
        """The next odometry, out of turn; None where none is held."""
        for k, event in enumerate(self._held):
            if isinstance(event, Odometry):
                del self._held[k]
                self._look(event)
                return event
        return None

    def _look(self, gone: Event | Detection) -> None:
        """Read on where little is held, and look for the next detection anew."""
        if len(self._held) <= self._low and not self._ended:
            self._fill()
        elif isinstance(gone, Detection):
            self._look_for_detections()

    def _fill(self) -> None:
        goal = self._read_to + HORIZON
        for _ in range(MOST_READ):
            event = next(self._events, None)
            if event is None:
                self._ended = True
                break
            self._held.append(event)
            if math.isfinite(event.t):
                self._stamps.append(event.t)
            if math.isinf(goal):
                goal = self._read_to + HORIZON
            if self._read_to > goal:
                break
        self._low = len(self._held) // 2
        self._look_for_detections()

    @property
    def _read_to(self) -> float:
        """Of the last two stamps the lower: one that is wrong does not count."""
        return min(self._stamps)

    def _look_for_detections(self) -> None:
        stamps = (e.t for e in self._held if isinstance(e, Detection) and math.isfinite(e.t))
        end = math.inf if self._ended else self._read_to
        self.until = min([*stamps, end])
