"""What a robot tells others: numbered, with its clock, and to whom."""

import threading
from typing import Protocol

from mcloc.team.inbox import Arrival
from mcloc.team.letters import Said, Sent
from mcloc.team.wire import encoded


class Carrier(Protocol):
    """Carries bytes between robots. They may be lost, come late, twice or in another order."""

    def clock(self) -> float:
        """s: this robot's clock, by which its messages and their arrivals are told."""

    def send(self, data: bytes, to: str | None) -> None:
        """To the robot of this name, or to all; it never waits for them."""

    def arrived(self) -> list[Arrival]:
        """What has come since it was last asked."""

    def wait(self, seconds: float) -> None:
        """Until something comes, or for so long."""

    def dropped(self) -> int:
        """How many messages came faster than they were asked for, and were left out."""

    def close(self) -> None:
        """No more is sent, and none comes."""


class Outbox:
    """Of the robot `name`, in its session. Threads may share it."""

    def __init__(self, name: str, session: int, carrier: Carrier) -> None:
        self._name, self._session, self._carrier = name, session, carrier
        self._next: dict[str | None, int] = {}
        self._told: dict[tuple[str, int], int] = {}
        self._lock = threading.Lock()

    def to_all(self, said: Said) -> None:
        """Tell all that are there."""
        with self._lock:
            self._carrier.send(self._numbered(said, None)[1], None)

    def to_one(self, peer: str, session: int, said: Said) -> tuple[int, bytes]:
        """Tell one of them, in this session of it; the number and the bytes of the message."""
        with self._lock:
            number, data = self._numbered(said, peer)
            self._told[peer, session] = self._told.get((peer, session), 0) + 1
            self._carrier.send(data, peer)
        return number, data

    def once_more(self, peer: str, data: bytes) -> None:
        """Send the same message again."""
        self._carrier.send(data, peer)

    def told(self, peer: str, session: int) -> int:
        """Messages to this peer alone, in this session of it."""
        return self._told.get((peer, session), 0)

    def _numbered(self, said: Said, to: str | None) -> tuple[int, bytes]:
        number = self._next.get(to, 0)
        self._next[to] = number + 1
        return number, encoded(Sent(self._name, self._session, number, self._carrier.clock()), said)
