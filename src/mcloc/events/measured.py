"""What the measurements of all sensors have in common."""

from collections.abc import Iterator
from typing import Any, ClassVar, Self


class Measured:
    """What a sensor tells.

    called: its name in messages; empty: that of one that is not `useful`. repeats: whether another
    one from the same place makes the same errors, so that the robot has to move before it is news.
    own: whether it is of the robot's own sensors, so that it can be lost by it. conclusive: whether
    one that fits badly is a sign that the robot is elsewhere.
    """

    __slots__ = ()

    called: ClassVar[str]
    empty: ClassVar[str]
    repeats: ClassVar[bool]
    own: ClassVar[bool] = True
    conclusive: ClassVar[bool] = True

    def parts(self) -> Iterator[Self]:
        """What was measured apart, each part with a source of its own."""
        yield self


def is_own(z: Any) -> bool:
    """Whether z is of the robot's own sensors. What is no event, in worlds of tiles, always is."""
    return not isinstance(z, Measured) or z.own


def is_conclusive(z: Any) -> bool:
    """Whether z, if it fits badly, is a sign that the robot is elsewhere; what is no event is."""
    return not isinstance(z, Measured) or z.conclusive
