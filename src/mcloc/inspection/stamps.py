"""Clocks: stamps grow by about one period from event to event."""

import math
from dataclasses import dataclass
from heapq import nlargest

from mcloc.inspection.decades import Decades
from mcloc.inspection.finding import Finding

ENOUGH = 20  # stamps, to tell what is usual
LONGEST = 5  # steps that are remembered: pauses come in many lengths, jumps are rare
JUMP = 10.0  # times the shortest of these, and …
LEAST_JUMP = 10.0  # s: robots stop, and loggers wait for them
PERIODS_BACK = 20.0  # a step back by more periods than that, and …
LEAST_STEP_BACK = 1.0  # s; less is an event that overtook another
OFTEN = 0.02  # share of the events that may be out of order, or repeat a stamp
TOGETHER = 0.5  # least part of the shorter of two streams during which the other runs, too


@dataclass(frozen=True, slots=True)
class Step:
    """From one stamp to the next, seconds."""

    before: float
    after: float

    @property
    def length(self) -> float:
        return self.after - self.before


class Stamps:
    """The stamps of one stream of events, in the order of the file.

    count, repeated, backward: events; those with the stamp of the one before them, and with an
    earlier one. first, last: the least and the greatest stamp, seconds. longest: the longest steps
    forwards, furthest_back: the longest one backwards, or None.
    """

    def __init__(self) -> None:
        self.count = self.repeated = self.backward = 0
        self.first, self.last = math.inf, -math.inf
        self.longest: list[Step] = []
        self.furthest_back: Step | None = None
        self._latest = math.nan
        self._periods = Decades()

    def add(self, t: float) -> None:
        """The next event's stamp, finite."""
        if self.count:
            self._step(Step(self._latest, t))
        self.count += 1
        self._latest = t
        self.first, self.last = min(self.first, t), max(self.last, t)

    def _step(self, step: Step) -> None:
        if step.length == 0.0:
            self.repeated += 1
        elif step.length < 0.0:
            self.backward += 1
            if self.furthest_back is None or step.length < self.furthest_back.length:
                self.furthest_back = step
        else:
            self._periods.add(step.length)
            self.longest = nlargest(LONGEST, [*self.longest, step], key=lambda long: long.length)

    @property
    def period(self) -> float:
        """Seconds: the median of the steps forwards, to 2.3 %; NaN without any."""
        return self._periods.median

    @property
    def longest_gap(self) -> float:
        """Seconds: the longest step forwards; NaN without any."""
        return self.longest[0].length if self.longest else math.nan

    @property
    def duration(self) -> float:
        """Seconds; 0 without events."""
        return max(self.last - self.first, 0.0)


def inspect_stamps(name: str, stamps: Stamps) -> list[Finding]:
    """What looks wrong with the clock of one stream that comes steadily."""
    if stamps.count < ENOUGH:
        return []
    jump = _jump_forward(name, stamps)
    return ([] if jump is None else [jump]) + inspect_order(name, stamps)


def inspect_order(name: str, stamps: Stamps) -> list[Finding]:
    """What looks wrong with the order of the stamps of one stream."""
    if stamps.count < ENOUGH:
        return []
    found = _jump_back(name, stamps) or _reordered(name, stamps), _repeated(name, stamps)
    return [finding for finding in found if finding is not None]


def _jump_forward(name: str, stamps: Stamps) -> Finding | None:
    """One step far longer than the next longest ones. Some logs grow only while the robot moves:
    they have many long steps.
    """
    if len(stamps.longest) < LONGEST:
        return None
    jump, usual = stamps.longest[0], stamps.longest[-1].length
    if jump.length <= max(LEAST_JUMP, JUMP * usual):
        return None
    return Finding(
        "clock-jumps-forward",
        name,
        f"the clock jumps, or nothing was recorded, for {jump.length:.1f} s",
        f"from t = {jump.before:.3f} s to {jump.after:.3f} s; all but {LONGEST - 1} steps take at"
        f" most {usual:.3g} s",
        "localize the two parts one by one, with --start and --end",
    )


def _jump_back(name: str, stamps: Stamps) -> Finding | None:
    """A step back over many periods: until the clock has caught up, all events come late."""
    back = stamps.furthest_back
    if back is None or -back.length <= max(LEAST_STEP_BACK, PERIODS_BACK * stamps.period):
        return None
    return Finding(
        "clock-jumps-back",
        name,
        f"the clock jumps back by {-back.length:.1f} s",
        f"from t = {back.before:.3f} s to {back.after:.3f} s; {stamps.backward} steps back in all",
        "cut the log there into two, or give the events the stamps of one steady clock",
    )


def _reordered(name: str, stamps: Stamps) -> Finding | None:
    """Events that come after later ones are left out when localizing: a few do not matter."""
    share, back = stamps.backward / stamps.count, stamps.furthest_back
    if back is None or share <= OFTEN:
        return None
    return Finding(
        "stamps-reordered",
        name,
        f"{100 * share:.0f} % of the events come after later ones",
        f"{stamps.backward} of {stamps.count}, by up to {-back.length:.3g} s",
        "sort the log by its stamps; late events are left out",
    )


def _repeated(name: str, stamps: Stamps) -> Finding | None:
    """Of events with one stamp all but the first are left out when localizing."""
    share = stamps.repeated / stamps.count
    if share <= OFTEN:
        return None
    return Finding(
        "stamps-repeated",
        name,
        f"{100 * share:.0f} % of the events repeat the stamp of the one before them",
        f"{stamps.repeated} of {stamps.count}",
        "record stamps of a finer clock, and each event once; repeated ones are left out",
    )


def inspect_overlap(odometry: Stamps, name: str, laser: Stamps) -> Finding | None:
    """Odometry and what a sensor measures are of one drive only if their clocks run at the same
    time.
    """
    if min(odometry.count, laser.count) < ENOUGH:
        return None
    shared = min(odometry.last, laser.last) - max(odometry.first, laser.first)
    if shared >= TOGETHER * min(odometry.duration, laser.duration):
        return None
    return Finding(
        "clocks-apart",
        name,
        "the stamps are of another time than those of the odometry",
        f"they are from t = {laser.first:.3f} s to {laser.last:.3f} s, odometry from"
        f" {odometry.first:.3f} s to {odometry.last:.3f} s",
        f"shift one of them; the {name} begins {laser.first - odometry.first:.3f} s after the"
        " odometry",
    )
