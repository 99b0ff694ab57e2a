"""Bel(x) = Π_i Bel(x_i): a team, whose robots localize each other where one sees another  [Fox01
Eq. 19.4.17, 19.4.18].
"""

from bisect import insort
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mcloc.density_tree import DensityTree
from mcloc.errors import ConfigError
from mcloc.events import Detection, Event, Measurement, Odometry
from mcloc.geometry import Pose
from mcloc.localizer import Estimate, Localizer
from mcloc.localizer.leap_guard import LEAP
from mcloc.maps.teammates import Teammates
from mcloc.sensors.messages import tree_of
from mcloc.team.detection import DetectionModel, message, to_seen, to_seer
from mcloc.team.policy import TeamPolicy, Used, farther
from mcloc.team.unseen import Unseen

SEEN, SEER, UNSEEN = 4 << 16, 5 << 16, 6 << 16
"""Parts of the random numbers, for the beliefs that are pushed."""
PATIENCE = 1.0  # s that a detection waits for the wheels of both robots
LOOKS = 0.2  # s between two looks whether the wheels have moved far


class Queued(NamedTuple):
    """A measurement of a robot, or a detection by it, that waits for its turn."""

    t: float
    robot: str
    event: Measurement | Detection


class Told(NamedTuple):
    """A message that was taken in at t (s), by whom; tree: of where it is."""

    t: float
    robot: str
    tree: DensityTree


class Team:
    """Robots by name, each with a localizer of its own: any filter, any sensors, one frame.

    Where robot i sees robot j, each of the two is told where it is by the belief of the other one:
    both by what was believed before, carried along the wheels to the stamp of the detection. A
    robot that has no place yet tells nothing. `used` counts the detections that were used, and
    `ignored` the others, by reason. `told` are the messages of the last event.

    Events of all robots come about in the order of time. Detections wait until the wheels of both
    robots are known; what was measured after them waits for them. Between measurements a robot that
    has a place follows its wheels in steps: one that is told where it is once in minutes must not
    be as sure of it after a loop as after a straight line.

    Where the model has p_detect > 0, a robot that another one has not seen for a window of time is
    told so, by what that one has in view. By default it is not: the paper does without, since what
    is told so often is soon told twice.

    Raises ConfigError for a team of one, and for localizers without Teammates among their aids.
    """

    def __init__(
        self,
        robots: Mapping[str, Localizer],
        model: DetectionModel | None = None,
        policy: TeamPolicy | None = None,
    ) -> None:
        if len(robots) < 2:
            raise ConfigError(f"a team has at least 2 robots, got {len(robots)}")
        for name, localizer in robots.items():
            if not any(isinstance(aid, Teammates) for aid in localizer.aids):
                raise ConfigError(
                    f"robot {name} cannot be told anything: give its localizer the aid Teammates()"
                )
        self.robots = dict(robots)
        self.model = model or DetectionModel()
        self.policy = policy or TeamPolicy()
        self.used = 0
        self.ignored: Counter[str] = Counter()
        self.told: list[Told] = []
        self._queue: list[Queued] = []
        self._last: dict[frozenset[str], Used] = {}
        self._unseen = Unseen(self.robots, self.model, self.policy)
        self._followed: dict[str, float] = {}  # s, when it was looked whether to follow the wheels

    def process(self, robot: str, event: Event | Detection) -> list[tuple[str, Estimate]]:
        """Take one event of a robot in; the estimates that it makes possible, with whose they are.
        Raises ConfigError for a robot that is not in the team.
        """
        if robot not in self.robots:
            raise ConfigError(f"there is no robot {robot} in the team of {', '.join(self.robots)}")
        self.told = []
        if isinstance(event, Odometry):
            found = self._estimates(robot, self.robots[robot].process(event))
            if event.t <= self.robots[robot].wheels_until:  # else they leap, and may be wrong
                self._refuse_leaps()
            found += self._release()
            if not np.isfinite(event.t):
                return found
            found += self._follow(robot, event.t)
            if self.model.p_detect > 0.0 and not self._queue:
                found += self._not_seen(robot, event.t - PATIENCE)
            return found
        if isinstance(event, Detection):
            reason = self._unusable(robot, event)
            if reason:
                self.ignored[reason] += 1
                return []
        elif not np.isfinite(event.t):
            return self._estimates(robot, self.robots[robot].process(event))
        insort(self._queue, Queued(event.t, robot, event), key=lambda waiting: waiting.t)
        return self._release()

    def finish(self) -> list[tuple[str, Estimate]]:
        """What still waits, with the last odometry there is."""
        self.told = []
        found = self._release(final=True)
        for name, localizer in self.robots.items():
            found += self._estimates(name, localizer.finish())
        return found

    def _release(self, final: bool = False) -> list[tuple[str, Estimate]]:
        """Process what waits, up to a detection for which the wheels are not known yet."""
        found: list[tuple[str, Estimate]] = []
        while self._queue:
            robot, event = self._queue[0][1:]
            if isinstance(event, Detection) and not final and not self._ready(robot, event):
                break
            self._queue.pop(0)
            if isinstance(event, Detection):
                found += self._detected(robot, event)
            else:
                found += self._estimates(robot, self.robots[robot].process(event))
        return found

    def _refuse_leaps(self) -> None:
        """Leave out detections that wait and whose stamps leap ahead of all wheels."""
        newest = self._wheels_until
        for one in [one for one in self._queue if one.t > newest + LEAP]:
            if isinstance(one.event, Detection):
                self._queue.remove(one)
                self.ignored["detection stamp from the future"] += 1

    def _ready(self, seer: str, z: Detection) -> bool:
        if all(self.robots[name].wheels_reach(z.t) for name in (seer, z.seen)):
            return True
        return self._wheels_until - z.t > PATIENCE

    @property
    def _wheels_until(self) -> float:
        """Seconds: the newest stamp of the wheels of any robot."""
        return max(one.wheels_until for one in self.robots.values())

    def _unusable(self, seer: str, z: Detection) -> str:
        """Why a detection can be of no use, or nothing."""
        if not np.isfinite(z.t):
            return "detection stamp not finite"
        if z.seen not in self.robots:
            return "detection of a robot that is not in the team"
        if z.seen == seer:
            return "detection of the robot itself"
        fault = self.model.fault(z)
        return f"detection {fault}" if fault else ""

    def _detected(self, seer: str, z: Detection) -> list[tuple[str, Estimate]]:
        """Each of the two is told where it is, by what the other one believed before."""
        both = {name: self.robots[name] for name in (seer, z.seen)}
        self._unseen.note(seer, z)
        found: list[tuple[str, Estimate]] = []
        for name, localizer in both.items():
            found += self._estimates(name, localizer.catch_up(z.t))
        at = {name: localizer.wheels_at(z.t) for name, localizer in both.items()}
        known = {name: pose for name, pose in at.items() if pose is not None}
        reason = self._untimely(z, both, known)
        if reason:
            self.ignored[reason] += 1
            return found
        i, j = both[seer], both[z.seen]
        messages = {}
        if i.placed:
            tree = to_seen(i.predicted(known[seer]), z, self.model, i.draws(SEEN))
            messages[z.seen] = message(z, tree, self.model, f"robot {seer}")
        if j.placed:
            tree = to_seer(j.predicted(known[z.seen]), z, self.model, j.draws(SEER))
            messages[seer] = message(z, tree, self.model, f"robot {z.seen}")
        news = self.policy.novelty(self._moved(known))
        for name, told in messages.items():
            told = replace(told, novelty=news)
            found += self._estimates(name, [both[name].take(told, known[name])])
            self.told.append(Told(z.t, name, tree_of(told)))
        self._last[frozenset(both)] = Used(z.t, known)
        self.used += 1
        return found

    def _not_seen(self, seer: str, since: float) -> list[tuple[str, Estimate]]:
        """Those that a robot has not seen for a window of time are told so, by what both believed
        at one moment from `since` on.
        """
        found: list[tuple[str, Estimate]] = []
        for name, t in self._unseen.due(seer, since):
            for one in (seer, name):
                found += self._estimates(one, self.robots[one].catch_up(t))
            message, at = self._unseen.told(seer, name, t)
            found += self._estimates(name, [self.robots[name].take(message, at)])
        return found

    def _moved(self, at: Mapping[str, Pose]) -> float:
        """Metres that the farther one of two robots is from where its wheels were at the last
        detection of the two that was used; ∞ before the first one.
        """
        last = self._last.get(frozenset(at))
        if last is None:
            return np.inf
        return farther(at, last.at)

    def _untimely(self, z: Detection, both: Mapping[str, Localizer], at: Mapping[str, Pose]) -> str:
        """Why a detection is not used now, or nothing."""
        if len(at) < len(both):
            return "detection without odometry"
        if any(z.t < localizer.done for localizer in both.values()):
            return "late detection"
        last = self._last.get(frozenset(both))
        if last is not None and not self.policy.due(abs(z.t - last.t), self._moved(at)):
            return "detection of the same robots again"
        if not any(localizer.placed for localizer in both.values()):
            return "detection between robots that have no place yet"
        return ""

    def _follow(self, robot: str, now: float) -> list[tuple[str, Estimate]]:
        """A step by the wheels alone, where a robot has moved far since the last one; not up to
        now, since something older may still come.
        """
        localizer, t = self.robots[robot], now - PATIENCE
        if self._queue or 0.0 <= t - self._followed.get(robot, -np.inf) < LOOKS:
            return []
        self._followed[robot] = t
        return self._estimates(robot, localizer.follow(t))

    def _estimates(
        self, robot: str, estimates: list[Estimate] | list[Estimate | None]
    ) -> list[tuple[str, Estimate]]:
        return [(robot, estimate) for estimate in estimates if estimate is not None]
