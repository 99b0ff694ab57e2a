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

    def told(self, seer: str, t: float) -> Iterator[tuple[str, Message, Pose]]:
        """Whom a robot tells at t that it has not seen them for a window of time: what it tells
        each, and the pose of that one's wheels. Only robots that have a place tell and are told.
        """
        i, began = self._robots[seer], self._began.setdefault(seer, t)
        for name, j in self._robots.items():
            last = self._told.get((seer, name))
            since = max(self._sighted.get((seer, name), began), last.t if last else began)
            if name == seer or t - since < self._policy.window or not (i.placed and j.placed):
                continue
            at = {who: self._robots[who].wheels_at(t) for who in (seer, name)}
            known = {who: pose for who, pose in at.items() if pose is not None}
            if len(known) < 2 or not t > max(i.done, j.done):
                continue
            moved = np.inf if last is None else farther(known, last.at)
            self._told[seer, name] = Used(t, known)
            view = self._views.setdefault(seer, View(i.grid))
            seen_from = i.predicted(known[seer]), self._model, f"robot {seer}"
            message = view.message(t, *seen_from, i.draws(UNSEEN))
            yield name, replace(message, novelty=self._policy.novelty(moved)), known[name]
