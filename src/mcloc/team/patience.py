"""How long a robot waits for another one that is behind it in the time of their logs.

Waiting costs, and what the other one goes on by earns: who keeps a pace is waited for as long as it
takes, and who says to go on without ever coming is not.
"""

import math

SLOWEST = 0.1  # of real time: who keeps this pace is waited for
FARTHEST = 3600.0  # s behind: to go on there earns nothing, since that could be said for ever


class Patience:
    """With one other robot. whole: s, that are waited for one that does not go on."""

    def __init__(self, whole: float) -> None:
        self._whole = self._left = whole
        self._reached = -math.inf  # s, in the time of the logs

    @property
    def over(self) -> bool:
        """Whether none is left."""
        return self._left <= 0.0

    def spend(self, seconds: float) -> None:
        """So long was waited."""
        self._left -= seconds

    def see(self, until: float, t: float) -> None:
        """The other one has come to `until`, and this one to t (s)."""
        reached = min(until, t)
        if reached > max(self._reached, t - FARTHEST):
            earned = (reached - self._reached) / SLOWEST
            self._left = min(self._left + earned, self._whole)
            self._reached = reached
