"""One robot of a team, in a process of its own: what `Team` does for two robots that it holds, this
does for one of them, by letters.

    the seer                                 the one that it sees
    pushes its belief ──── notice ─────────▶ carries its own to the stamp of it, and pushes it
    takes in what it is told ◀──── reply ─── takes in what it was told

Both push what they believed before.
"""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mcloc.density_tree import DensityTree
from mcloc.events import Detection, Event, Odometry
from mcloc.geometry import Pose
from mcloc.localizer import Estimate, Localizer
from mcloc.team.common import common_of
from mcloc.team.detection import DetectionModel, message, to_seen, to_seer
from mcloc.team.inbox import Peer
from mcloc.team.letters import WHY, Notice, Refusal, Reply
from mcloc.team.policy import TeamPolicy
from mcloc.team.post import Due, Post
from mcloc.team.team import PATIENCE, SEEN, SEER

LATE, AGAIN, WITHOUT_WHEELS, NOWHERE = WHY


@dataclass(frozen=True, slots=True)
class Used:
    """When a sighting of two robots was last used, and the pose of this one's wheels then."""

    t: float
    at: Pose


class Member:
    """A robot with its localizer and its post.

    more_wheels: the robot's next odometry, out of turn, or None where there is none yet. used:
    sightings by it and of it that were used. ignored: those by it that were not, by reason. found,
    withheld: estimates, and stamps and wheels' poses where the filter withheld one, that nobody has
    taken yet.
    """

    def __init__(
        self,
        localizer: Localizer,
        post: Post,
        model: DetectionModel | None = None,
        policy: TeamPolicy | None = None,
        more_wheels: Callable[[], Odometry | None] = lambda: None,
    ) -> None:
        self.localizer, self.post, self._more_wheels = localizer, post, more_wheels
        self.model, self.policy = model or DetectionModel(), policy or TeamPolicy()
        post.inbox.common = common_of(localizer, self.model)
        self.used = 0
        self.ignored: Counter[str] = Counter()
        self.found: list[Estimate] = []
        self.withheld: list[tuple[float, Pose]] = []
        self._last: dict[tuple[str, int], Used] = {}
        self._asking: Detection | None = None
        self._followed = -math.inf  # s, when it was looked whether to follow the wheels

    def process(self, event: Event | Detection) -> None:
        """Take one event of the robot in."""
        if isinstance(event, Detection):
            reason = self._see(event)
            if reason:
                self.ignored[f"detection {reason}"] += 1
            return
        self._note(self.localizer.process(event))
        if isinstance(event, Odometry):
            self._follow(self.localizer.wheels_until - PATIENCE)

    def taken(self) -> tuple[list[Estimate], list[tuple[float, Pose]]]:
        """What was found and withheld since this was last asked."""
        taken, self.found, self.withheld = (self.found, self.withheld), [], []
        return taken

    def finish(self) -> None:
        """What still waits, with the last odometry there is."""
        self._note(self.localizer.finish())

    def answer_due(self, t: float) -> None:
        """Answer the notices with stamps up to t; what was measured before them is processed."""
        while self.post.due and self.post.due[0].t <= t:
            due = self.post.due.pop(0)
            said = self._answered(due)
            self.post.answer(due.sent, said)
            if isinstance(said, Reply):
                z, other = due.notice.z, (due.sent.sender, due.sent.session)
                self._use(z, other, said.moved, due.notice.tree)

    def _see(self, z: Detection) -> str:
        """Tell the other robot, and take in what it tells; why that came to nothing, if it did."""
        peer = self.post.inbox.peers.get(z.seen)
        reason = self._unusable(z) or self._unheard(peer)
        if reason or peer is None:
            return reason
        at = self._at(z.t)
        if at is None:
            return WITHOUT_WHEELS
        if z.t < self.localizer.done:
            return LATE
        tree = None
        if self.localizer.placed:
            belief = self.localizer.predicted(at)
            tree = to_seen(belief, z, self.model, self.localizer.draws(SEEN))
        notice = Notice(z, *self._since((peer.name, peer.session), at), tree)
        self._asking = z
        answer = self.post.ask(peer, notice, meanwhile=lambda: self.answer_due(z.t))
        self._asking = None
        match answer:
            case None:
                return "without an answer"
            case Refusal():
                return answer.why
            case Reply():
                other = peer.name, peer.session  # maybe of a process that was started meanwhile
                self._use(z, other, answer.moved, answer.tree)
        return ""

    def _answered(self, due: Due) -> Reply | Refusal:
        """What is answered to a notice, by what is believed before it."""
        z, seer = due.notice.z, due.sent.sender
        about = seer, due.sent.session, due.sent.number, z.t
        asking = self._asking
        if asking is not None and asking.seen == seer and self.post.name < seer:
            return Refusal(*about, AGAIN)  # each saw the other: this one's notice is used
        at = self._at(z.t)
        if at is None:
            return Refusal(*about, WITHOUT_WHEELS)
        if z.t < self.localizer.done:
            return Refusal(*about, LATE)
        last, moved = self._since((seer, due.sent.session), at)
        last, moved = max(last, due.notice.last), _farther(moved, due.notice.moved)
        if not self.policy.due(z.t - last, moved):
            return Refusal(*about, AGAIN)
        tree = None
        if self.localizer.placed:
            belief = self.localizer.predicted(at)
            tree = to_seer(belief, z, self.model, self.localizer.draws(SEER))
        elif due.notice.tree is None:
            return Refusal(*about, NOWHERE)
        return Reply(*about, moved, tree)

    def _use(
        self, z: Detection, other: tuple[str, int], moved: float, tree: DensityTree | None
    ) -> None:
        """Take in what the other one told, and remember when that was."""
        at = self._at(z.t)
        assert at is not None  # else the sighting was refused
        self.used += 1
        self._last[other] = Used(z.t, at)
        if tree is not None:
            told = message(z, tree, self.model, f"robot {other[0]}")
            told = replace(told, novelty=self.policy.novelty(moved))
            self._note([self.localizer.take(told, at)])

    def _since(self, other: tuple[str, int], at: Pose) -> tuple[float, float]:
        """s and m: when a sighting of the two was last used, and how far the wheels have come
        since; −∞ and ∞ if none was.
        """
        last = self._last.get(other)
        if last is None:
            return -math.inf, math.inf
        return last.t, float(np.hypot(*(at - last.at)[:2]))

    def _unusable(self, z: Detection) -> str:
        """Why a detection can be of no use, or nothing."""
        if not math.isfinite(z.t):
            return "stamp not finite"
        if z.seen == self.post.name:
            return "of the robot itself"
        return self.model.fault(z)

    def _unheard(self, peer: Peer | None) -> str:
        """Why a robot cannot be told of it, or nothing."""
        if peer is None or self.post.inbox.gone(peer, self.post.now()):
            return "of a robot that is not heard"
        if not self.post.inbox.trusted(peer):
            return "of a robot whose clock is not trusted"
        return self.post.inbox.barred(peer)

    def _at(self, t: float) -> Pose | None:
        """The wheels' pose at t, once what was measured up to then is processed."""
        while not self.localizer.wheels_reach(t):
            odometry = self._more_wheels()
            if odometry is None:
                break
            self._note(self.localizer.process(odometry))
        self._note(self.localizer.catch_up(t))
        return self.localizer.wheels_at(t)

    def _follow(self, t: float) -> None:
        """A step by the wheels alone up to t, where the robot has moved far since the last one."""
        localizer = self.localizer
        waits = bool(self.post.due) and self.post.due[0].t <= t
        if waits or not t > self._followed:
            return
        self._followed = t + 0.2
        self._note(localizer.follow(t))

    def _note(self, estimates: list[Estimate] | list[Estimate | None]) -> None:
        self.found += [estimate for estimate in estimates if estimate is not None]
        self.withheld += self.localizer.withheld
        self.localizer.withheld = []


def _farther(a: float, b: float) -> float:
    """The larger of two distances. One that is not known, of a robot that missed what the other one
    used, does not count.
    """
    known = [moved for moved in (a, b) if math.isfinite(moved)]
    return max(known, default=math.inf)
