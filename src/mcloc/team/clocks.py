"""How far another clock is ahead of this one: an interval that it lies in, whatever the delays.

A message that left when the other clock showed p, and came when this one showed a, was at most
a − p late:  offset ≥ p − a. If it answers one that left here at c and was held there for s, then it
left after c + s:  offset ≤ p − c − s. [Mills, Internet time synchronization, IEEE Trans. Commun.
1991, takes the middle of the two.]
"""

import math
from dataclasses import dataclass

KEPT = 60.0  # s that an interval is good for: clocks drift, by some 10⁻⁴ at most
ROUNDING = 1e-3  # s


@dataclass(slots=True)
class ClockOffset:
    """low, high: seconds by which the other clock is ahead; at: when both were last narrowed."""

    low: float = -math.inf
    high: float = math.inf
    at: float = -math.inf

    def note(self, low: float, high: float, now: float) -> None:
        """Another interval. Where it has no point in common with what was known, or that is old,
        the new one holds. now: s, on a clock that is never set.
        """
        if low > high + ROUNDING:  # answered before it was asked: nothing to learn from
            return
        contradicts = low > self.high + ROUNDING or high < self.low - ROUNDING
        if contradicts or (now - self.at > KEPT and math.isfinite(high)):
            self.low, self.high, self.at = low, high, now
        elif low > self.low or high < self.high:
            self.low, self.high, self.at = max(low, self.low), min(high, self.high), now

    @property
    def known(self) -> bool:
        """Whether it has both ends."""
        return math.isfinite(self.low) and math.isfinite(self.high)

    @property
    def middle(self) -> float:
        """s, the best guess; NaN where an end is not known."""
        return 0.5 * (self.low + self.high) if self.known else math.nan

    def beyond(self, bound: float) -> str:
        """Where it surely lies beyond ±bound, or nothing."""
        if self.low > bound:
            return "ahead"
        return "behind" if self.high < -bound else ""
