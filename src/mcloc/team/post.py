"""The letters of one robot: heartbeats to all, notices and what is answered to them."""

import math
import threading
import time
from bisect import insort
from collections import Counter, OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from mcloc.team.inbox import Inbox, Peer
from mcloc.team.letters import Farewell, Heartbeat, Notice, Refusal, Reply, Sent
from mcloc.team.outbox import Carrier, Outbox
from mcloc.team.peer_policy import PeerPolicy

MOST_NOTICES = 64  # of one peer, that wait for their stamp
MOST_ANSWERS = 256  # that are remembered, to be sent again
WAIT = 0.02  # s, for something to come


@dataclass(frozen=True, slots=True)
class Due:
    """A notice that waits for its stamp."""

    t: float
    sent: Sent
    notice: Notice


class Post:
    """Of the robot `name`, by a carrier.

    position, until: s, as of a Heartbeat. due: notices in the order of their stamps. sizes: bytes
    of each message that told of a sighting. now: s, a clock that is never set.
    """

    def __init__(
        self,
        name: str,
        carrier: Carrier,
        policy: PeerPolicy,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        session = int(carrier.clock() * 1e9)
        self.name, self.policy, self.now = name, policy, now
        self.inbox = Inbox(name, session, policy)
        self.position, self.until = -math.inf, math.nan
        self.due: list[Due] = []
        self.sizes: list[int] = []
        self._carrier = carrier
        self._outbox = Outbox(name, session, carrier)
        self._asked: tuple[str, int] | None = None
        self._answer: Reply | Refusal | None = None
        self._answers: OrderedDict[tuple[str, int, int], bytes] = OrderedDict()
        self._left_out: Counter[str] = Counter()
        self._lock = threading.Lock()

    def beat(self) -> None:
        """Say that the robot is there, and where in time; from any thread."""
        with self._lock:
            heard = self.inbox.heard(self.now(), self._outbox.told)
        self._outbox.to_all(Heartbeat(self.position, self.until, heard, self.inbox.common))

    def leave(self) -> None:
        """Say farewell."""
        self._outbox.to_all(Farewell())

    def serve(self, wait: float = 0.0) -> None:
        """Take in what has come. wait: s, for something to come."""
        if wait > 0.0:
            self._carrier.wait(wait)
        for arrival in self._carrier.arrived():
            with self._lock:
                letter = self.inbox.take(arrival)
            if letter is not None:
                self._sort(*letter)
        while self.inbox.repeated:
            again = self.inbox.repeated.popleft()
            if again in self._answers:
                self._outbox.once_more(again[0], self._answers[again])

    def clock(self) -> float:
        """s: the robot's clock."""
        return self._carrier.clock()

    def live(self) -> list[Peer]:
        """The peers that are heard of."""
        return self.inbox.live(self.now())

    def ask(
        self, peer: Peer, notice: Notice, meanwhile: Callable[[], None]
    ) -> Reply | Refusal | None:
        """Tell a peer of a sighting, as often as it takes; what it answers, None where it does not.
        meanwhile: is called again and again.
        """
        number, data = self._outbox.to_one(peer.name, peer.session, notice)
        self._asked = peer.name, number
        self._answer, began = None, self.now()
        self.sizes.append(len(data))
        told = began
        while self._answer is None:
            now = self.now()
            if now - began > self.policy.reply_wait or self.inbox.gone(peer, now):
                break
            if now - told > self.policy.again:
                self._outbox.once_more(peer.name, data)
                told = now
            self.serve(wait=WAIT)
            meanwhile()
        self._asked = None
        return self._answer

    def answer(self, to: Sent, said: Reply | Refusal) -> None:
        """Answer a notice; the same again whenever it comes again."""
        _, data = self._outbox.to_one(to.sender, to.session, said)
        if isinstance(said, Reply):
            self.sizes.append(len(data))
        self._answers[to.sender, to.session, to.number] = data
        if len(self._answers) > MOST_ANSWERS:
            self._answers.popitem(last=False)

    @property
    def dropped(self) -> Counter[str]:
        """Messages that were left out, by reason, and those that never came."""
        lost = sum(peer.missing for peer in self.inbox.peers.values())
        more = {"lost on the way": lost, "too many at once": self._carrier.dropped()}
        return self.inbox.dropped + self._left_out + Counter(more)

    def _sort(self, sent: Sent, said: Notice | Reply | Refusal) -> None:
        if isinstance(said, Notice):
            if sum(due.sent.sender == sent.sender for due in self.due) >= MOST_NOTICES:
                self._left_out["too many notices at once"] += 1
            else:
                insort(self.due, Due(said.z.t, sent, said), key=lambda due: due.t)
        elif (sent.sender, said.number) == self._asked:
            self._answer = said
        else:
            self._left_out["answer that came too late"] += 1
