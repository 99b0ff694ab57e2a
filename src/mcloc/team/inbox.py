"""The bytes that come from others, judged: what may be used, and how many of the rest, by reason.

No transport and no clock of its own: bytes come with the time of their arrival. Whatever comes, its
memory is bounded, nothing is executed, and nothing raises.
"""

import math
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field

from mcloc.errors import MessageError
from mcloc.team.clocks import ClockOffset
from mcloc.team.letters import (
    MOST_HEARD,
    Common,
    Farewell,
    Heard,
    Heartbeat,
    Notice,
    Refusal,
    Reply,
    Said,
    Sent,
)
from mcloc.team.numbering import Numbering
from mcloc.team.peer_policy import PeerPolicy
from mcloc.team.wire import Envelope, opened

Letter = tuple[Sent, Notice | Reply | Refusal]

NAMESAKE = "of another robot of this name"

MOST_AHEAD = 1024
"""Messages of a peer that are missed at once, at most: it may say that it sent any number."""


@dataclass(frozen=True, slots=True)
class Arrival:
    """Bytes. sender: who the transport says that they come from. clock: s, this robot's clock when
    they came. now: s, then, on a clock that is never set.
    """

    data: bytes
    sender: str
    clock: float
    now: float


@dataclass(slots=True)
class Peer:
    """Another robot, as far as it is heard. heard: `now` when it last was. position, until, common:
    as of its last heartbeat. beat: that heartbeat's clock, and `now` when it came. echoed: s, what
    this robot's clock was when it sent the last heartbeat that the peer says to have heard. told:
    messages that it says to have sent to this robot alone. lost: those that did not come, of
    earlier sessions.
    """

    name: str
    session: int
    heard: float
    position: float = -math.inf
    until: float = math.nan
    common: Common = field(default_factory=Common)
    beat: tuple[float, float] | None = None
    offset: ClockOffset = field(default_factory=ClockOffset)
    to_all: Numbering = field(default_factory=Numbering)
    to_one: Numbering = field(default_factory=Numbering)
    echoed: float = -math.inf
    told: int = 0
    lost: int = 0
    sessions: int = 1
    left: bool = False

    def begin(self, session: int, now: float) -> None:
        """Its process was started anew."""
        self.lost, self.sessions = self.missing, self.sessions + 1
        self.session, self.heard, self.left = session, now, False
        self.position, self.until, self.common = -math.inf, math.nan, Common()
        self.beat, self.echoed, self.offset, self.told = None, -math.inf, ClockOffset(), 0
        self.to_all, self.to_one = Numbering(), Numbering()

    @property
    def missing(self) -> int:
        """Messages to this robot alone that have not come."""
        return self.lost + max(self.to_one.missing, self.told - self.to_one.came)


class Inbox:
    """Judges what comes for the robot `name`, in its session. common: what that should have in
    common with others.

    peers: by name, also those that are gone, at most MOST_HEARD. dropped: how many messages were
    left out, by reason. repeated: sender, session and number of the last duplicates of letters.
    """

    def __init__(self, name: str, session: int, policy: PeerPolicy) -> None:
        self.name, self.session, self.policy = name, session, policy
        self.common = Common()
        self.peers: dict[str, Peer] = {}
        self.dropped: Counter[str] = Counter()
        self.repeated: deque[tuple[str, int, int]] = deque(maxlen=MOST_HEARD)

    def take(self, arrival: Arrival) -> Letter | None:
        """What may be used; None for what only says that a robot is there, and for what is left out
        and counted.
        """
        try:
            envelope = opened(arrival.data)
            if self._echoes(envelope.sent, arrival):
                return None
            self._check_envelope(envelope, arrival)
            return self._judged(envelope.sent, envelope.said(), arrival)
        except MessageError as why:
            self.dropped[str(why)] += 1
            return None

    def live(self, now: float) -> list[Peer]:
        """Those that are heard of, and have not left."""
        return [p for p in self.peers.values() if not self.gone(p, now)]

    def gone(self, peer: Peer, now: float) -> bool:
        """Whether it has left, or is silent for too long."""
        return peer.left or now - peer.heard > self.policy.silence

    def trusted(self, peer: Peer) -> bool:
        """Whether its clock is known not to be too far off."""
        return peer.offset.known and not peer.offset.beyond(self.policy.clock_bound)

    def barred(self, peer: Peer) -> str:
        """Why nothing can be used that it tells of sightings, or nothing."""
        where = peer.offset.beyond(self.policy.clock_bound)
        if where and peer.offset.known:
            return f"of a clock too far {where}"
        alike = "detection" not in self.differing(peer)
        return "" if alike else "of a robot with another detection model"

    def differing(self, peer: Peer) -> list[str]:
        """What it should have in common with this robot, and has not."""
        return self.common.differing(peer.common)

    def heard(self, now: float, told: Callable[[str, int], int]) -> tuple[Heard, ...]:
        """What the next heartbeat says of others. told: messages to a peer in a session of it."""
        return tuple(
            Heard(p.name, p.session, p.beat[0], now - p.beat[1], told(p.name, p.session))
            for p in self.live(now)
            if p.beat is not None
        )

    def _echoes(self, sent: Sent, arrival: Arrival) -> bool:
        """Whether it is one of this robot's own."""
        return sent.sender == arrival.sender == self.name and sent.session == self.session

    def _check_envelope(self, envelope: Envelope, arrival: Arrival) -> None:
        """Raise for what need not be read: a flood of it must cost little. Nothing is noted yet."""
        sent, alone = envelope.sent, _alone(envelope.kind)
        if sent.sender != arrival.sender:
            raise MessageError("under the name of another robot")
        if sent.sender == self.name:
            raise MessageError(NAMESAKE)
        peer = self.peers.get(sent.sender)
        if peer is not None and sent.session != peer.session:
            if sent.session < peer.session and arrival.now - peer.heard <= self.policy.silence:
                raise MessageError("of an earlier session")
            peer = None  # after a silence, one with a clock set back is a new one as well
        if alone and (peer is None or not peer.offset.known):  # it may come again
            raise MessageError("of a clock not compared yet")
        if peer is None:
            return
        stale = _numbering(peer, alone).stale(sent.number)
        if stale:
            if alone:
                self.repeated.append((sent.sender, sent.session, sent.number))
            raise MessageError(stale)
        if peer.left:
            raise MessageError("after its farewell")

    def _judged(self, sent: Sent, said: Said, arrival: Arrival) -> Letter | None:
        peer = self._peer(sent, arrival.now)
        fault = _numbering(peer, _alone(type(said))).fault(sent.number)
        if fault:
            raise MessageError(fault)
        peer.heard = arrival.now
        self._compare(peer, sent, said, arrival)
        match said:
            case Heartbeat():
                self._beaten(peer, sent, said, arrival)
                return None
            case Farewell():
                peer.left = True
                return None
        self._check(peer, said)
        return sent, said

    def _peer(self, sent: Sent, now: float) -> Peer:
        """The one that sends, in its present session."""
        peer = self.peers.get(sent.sender)
        if peer is None:
            self._make_room(now)
            peer = self.peers[sent.sender] = Peer(sent.sender, sent.session, now)
        elif sent.session != peer.session:
            peer.begin(sent.session, now)
        return peer

    def _make_room(self, now: float) -> None:
        if len(self.peers) < MOST_HEARD:
            return
        silent = min(self.peers.values(), key=lambda p: p.heard)
        if not self.gone(silent, now):
            raise MessageError("of more robots than a team may have")
        del self.peers[silent.name]

    def _compare(self, peer: Peer, sent: Sent, said: Said, arrival: Arrival) -> None:
        """Narrow what is known of its clock."""
        high = math.inf
        for h in said.heard if isinstance(said, Heartbeat) else ():
            if h.peer == self.name and h.session == self.session and h.since >= 0.0:
                high = sent.clock - h.clock - h.since
                peer.told = max(peer.told, min(h.told, peer.to_one.came + MOST_AHEAD))
                peer.echoed = max(peer.echoed, h.clock)
        peer.offset.note(sent.clock - arrival.clock, high, arrival.now)

    def _beaten(self, peer: Peer, sent: Sent, said: Heartbeat, arrival: Arrival) -> None:
        """Note where it is. A heartbeat that was overtaken takes nothing back."""
        if sent.number < peer.to_all.highest:
            return
        peer.beat = sent.clock, arrival.now
        peer.position, peer.until, peer.common = said.position, said.until, said.common

    def _check(self, peer: Peer, said: Notice | Reply | Refusal) -> None:
        barred = self.barred(peer)
        if barred:
            raise MessageError(barred)
        asked = said.z.seen if isinstance(said, Notice) else said.seer
        if asked != self.name:
            raise MessageError("for another robot")
        if isinstance(said, Reply | Refusal) and said.session != self.session:
            raise MessageError("about an earlier session")


def _alone(kind: type[Said]) -> bool:
    """Whether what is of this kind is told to one robot alone."""
    return kind not in (Heartbeat, Farewell)


def _numbering(peer: Peer, alone: bool) -> Numbering:
    return peer.to_one if alone else peer.to_all
