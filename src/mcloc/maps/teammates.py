"""Teammates: other robots on the same map, which can tell a robot where it is."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Teammates:
    """That there are others. Who they are, their messages say."""

    name: str = "teammates"  # for messages to the user

    @property
    def checksum(self) -> str:
        """The same for any team: robots may join and leave."""
        return "teammates"
