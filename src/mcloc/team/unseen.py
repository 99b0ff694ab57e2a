"""Robots that were not seen: who is told so, and when."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from mcloc.events import Detection, Message
from mcloc.geometry import Pose
from mcloc.localizer import Localizer
from mcloc.team.absence import View
from mcloc.team.detection import DetectionModel
from mcloc.team.policy import TeamPolicy, Used, farther

UNSEEN = 6 << 16  # part of the random numbers

Pair = tuple[str, str]
"""Who looks, and who is not seen."""


class Unseen:
    """Of each two robots of a team, when one last saw the other one, and when it last told it that
    it does not.
    """

    def __init__(
        self, robots: Mapping[str, Localizer], model: DetectionModel, policy: TeamPolicy
    ) -> None:
        self._robots, self._model, self._policy = robots, model, policy
        self._views: dict[str, View] = {}
        self._sighted: dict[Pair, float] = {}  # s, of detections that were used and others
        self._told: dict[Pair, Used] = {}
        self._began: dict[str, float] = {}  # s, when it was first asked about a robot that looks

    def note(self, seer: str, z: Detection) -> None:
        """A robot was seen."""
        self._sighted[seer, z.seen] = z.t

    def due(self, seer: str, since: float) -> Iterator[tuple[str, float]]:
        """Whom a robot is to tell that it has not seen them for a window of time, and at which
        moment it did not. Only robots that have a place tell and are told.

        since: seconds; nothing older will come. Filters do not go back, and where one of the two is
        past that, the moment is where it is: a detection from before comes too late for it anyway.
        """
        i, began = self._robots[seer], self._began.setdefault(seer, since)
        for name, j in self._robots.items():
            last = self._told.get((seer, name))
            before = max(self._sighted.get((seer, name), began), last.t if last else began)
            t = max(since, i.done, j.done)
            if name == seer or t - before < self._policy.window or not (i.placed and j.placed):
                continue
            if len(self._wheels(seer, name, t)) == 2:
                yield name, t

    def told(self, seer: str, name: str, t: float) -> tuple[Message, Pose]:
        """What it tells one of them about that moment, and the pose of that one's wheels."""
        i, last, at = self._robots[seer], self._told.get((seer, name)), self._wheels(seer, name, t)
        moved = np.inf if last is None else farther(at, last.at)
        self._told[seer, name] = Used(t, at)
        view = self._views.setdefault(seer, View(i.grid))
        seen_from = i.predicted(at[seer]), self._model, f"robot {seer}"
        message = view.message(t, *seen_from, i.draws(UNSEEN))
        return replace(message, novelty=self._policy.novelty(moved)), at[name]

    def _wheels(self, seer: str, name: str, t: float) -> dict[str, Pose]:
        """Their poses at t, of those of the two robots whose wheels have come there."""
        reached = [who for who in (seer, name) if self._robots[who].wheels_reach(t)]
        at = {who: self._robots[who].wheels_at(t) for who in reached}
        return {who: pose for who, pose in at.items() if pose is not None}
