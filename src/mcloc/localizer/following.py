"""A step by the wheels alone, for a robot that has moved far since anything was measured."""

import numpy as np

from mcloc.localizer.estimate import Estimate
from mcloc.localizer.localizer import Localizer
from mcloc.sensors.messages import silence

WHEELS = "wheels"  # the source of messages that say nothing


def followed(localizer: Localizer, t: float) -> list[Estimate]:
    """The estimates at t, and of what waited with a stamp up to t; none where the robot has moved
    less than its policy's `coast` since its filter's last step.

    A robot that measures nothing for minutes must not be as sure of its place after a loop as after
    a straight line: the noise of a move is that of its pieces.
    """
    far = localizer.policy.coast
    if not localizer.placed or not t > localizer.done or not _moved(localizer, t, far):
        return []
    # A sighting after minutes without any waits for the next one, to be confirmed by its stamp.
    found = localizer.catch_up(t)
    if t > localizer.done and _moved(localizer, t, far):
        at = localizer.wheels_at(t)
        assert at is not None
        told = localizer.take(silence(t, WHEELS), at)
        found += [] if told is None else [told]
    return found


def _moved(localizer: Localizer, t: float, far: float) -> bool:
    """Whether it is known to have moved as far, or where it started is all that is known."""
    at = localizer.wheels_at(t)
    if at is None:
        return False
    moved = localizer.moved_since_step(at)
    return moved is None or max(float(np.hypot(*moved[:2])), abs(float(moved[2]))) >= far
