"""A recorded log in a team of processes: together in the time of the logs, whatever each of them
takes to compute.

A robot tells before which stamp it will not see another one, and no other passes that stamp before
it: then a notice never comes too late [Chandy, Misra, Distributed simulation, IEEE Trans. Software
Eng. 1979]. Who is gone, or does not go on, is not waited for.
"""

import math
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from mcloc.events import Detection, Event, Odometry
from mcloc.geometry import Pose, between
from mcloc.team.inbox import Peer
from mcloc.team.look_ahead import LookAhead
from mcloc.team.member import Member
from mcloc.team.patience import Patience
from mcloc.team.post import WAIT, Post
from mcloc.team.remarks import Remarks, silent


@contextmanager
def pulse(post: Post) -> Iterator[None]:
    """Heartbeats from a thread, also while the robot computes; a farewell at the end."""
    end = threading.Event()

    def beat() -> None:
        while not end.wait(post.policy.heartbeat):
            post.beat()

    thread = threading.Thread(target=beat, name="pulse", daemon=True)
    thread.start()
    try:
        yield
    finally:
        end.set()
        thread.join()
        post.beat()  # with the last counts
        post.leave()


class Joining:
    """A member that replays a log. skipped: events before the time at which it joined.
    not_awaited: how often a robot that did not go on was no longer waited for, by name. beyond:
    robots by name, 1 where all of the log is before the time that they say to be at, so that it was
    not joined. say: is told in words, once each, what somebody should know.
    """

    def __init__(
        self, member: Member, ahead: LookAhead, say: Callable[[str], None] = silent
    ) -> None:
        self.member, self.post, self._ahead = member, member.post, ahead
        self._remarks = Remarks(member.post, say)
        self.skipped = 0
        self.not_awaited: Counter[str] = Counter()
        self.beyond: Counter[str] = Counter()
        self._patience: dict[str, Patience] = {}
        self._given_up: set[str] = set()

    def run(self, peers: int = 0) -> Iterator[Event | Detection | None]:
        """Go through the log, once `peers` others are there or patience ends; each event that has
        been processed, and None where there was none. The member holds what was found by then.
        """
        with pulse(self.post):
            self._wait_for(peers)
            self._join()
            self._skip()
            while (event := self._ahead.next) is not None:
                self._be(self._ahead.until)
                t = self._ahead.stamp
                self._hold(t)
                if self._ahead.next is not event:
                    continue  # an answer took it out of turn
                self._ahead.pop()
                self.member.process(event)
                if math.isfinite(t):
                    self.post.position = t
                yield event
            self._be(math.inf)
            self._linger()
            self.member.finish()
            yield None

    def _serve(self, wait: float = 0.0) -> None:
        """Take in what has come, and say what is odd about it."""
        self.post.serve(wait)
        self._remarks.look()

    def _be(self, until: float) -> None:
        """Let the others know at once how far they can go."""
        if until != self.post.until:
            self.post.until = until
            self.post.beat()

    def _wait_for(self, peers: int) -> None:
        """Until so many others are there."""
        end = self.post.now() + self.post.policy.patience
        while len(self.post.live()) < peers and self.post.now() < end:
            self._serve(wait=WAIT)
        there = len(self.post.live())
        if there < peers:
            self._remarks.once(
                f"{self.post.name} begins with {there} of the {peers} others that it waited for"
            )

    def _join(self) -> None:
        """Find out where the others are in the time of their logs: they hold as long as `until` is
        −∞, and a heartbeat that answers one of this robot's since then tells where.
        """
        asked, end = self.post.clock(), self.post.now() + self.post.policy.patience
        self._be(-math.inf)
        while self.post.now() < end:
            self._serve(wait=WAIT)
            if all(peer.echoed >= asked for peer in self._others()):
                break

    def _skip(self) -> None:
        """Leave out what was before the others' time: that of the one that has come farthest in
        this log. A robot that has moved meanwhile does not know any more where it is.
        """
        wheels: list[Pose] = []
        begun = [peer for peer in self._others() if peer.position > -math.inf]
        for peer in sorted(begun, key=lambda peer: peer.position, reverse=True):
            wheels = self._skip_to(peer.position)
            if self._ahead.next is not None:
                break
            self.beyond[peer.name] += 1
            self._ahead.rewind()
            self.skipped, wheels = 0, []
        localizer = self.member.localizer
        if wheels and localizer.policy.due(between(wheels[0], wheels[-1])):
            localizer.start_globally()

    def _skip_to(self, t: float) -> list[Pose]:
        """The poses of the wheels before t, of which the events are left out."""
        wheels = []
        while (event := self._ahead.next) is not None and self._ahead.stamp < t:
            self._ahead.pop()
            self.skipped += 1
            if isinstance(event, Odometry):
                wheels.append(event.pose)
        return wheels

    def _hold(self, t: float) -> None:
        """Until nobody may tell of a sighting before t any more; what is due is answered."""
        while True:
            self._serve()
            self.member.answer_due(t)
            if not self._waited(t):
                return

    def _waited(self, t: float) -> bool:
        """Whether anybody is still waited for at t; then a little time has passed."""
        behind = [peer.name for peer in self.post.live() if self._holds(peer, t)]
        if not behind:
            return False
        began = self.post.now()
        self._serve(wait=WAIT)
        for name in behind:
            self._patience[name].spend(self.post.now() - began)
        return True

    def _holds(self, peer: Peer, t: float) -> bool:
        """Whether it is to be waited for."""
        if math.isnan(peer.until):  # it waits for others itself
            return False
        patience = self._patience.setdefault(peer.name, Patience(self.post.policy.patience))
        patience.see(peer.until, t)
        if not peer.until < t or self.post.inbox.barred(peer):
            return False
        if not patience.over:
            self._given_up.discard(peer.name)
        elif peer.name not in self._given_up:
            self._given_up.add(peer.name)
            self.not_awaited[peer.name] += 1
        return not patience.over

    def _others(self) -> list[Peer]:
        """Those that can be worked with, or may be once their clocks are compared."""
        return [peer for peer in self.post.live() if not self.post.inbox.barred(peer)]

    def _linger(self) -> None:
        """Answer others that have not come as far as this log's end."""
        while self._waited(math.nextafter(self.post.position, math.inf)):
            self.member.answer_due(math.inf)
        self.member.answer_due(math.inf)
