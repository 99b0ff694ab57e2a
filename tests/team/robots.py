"""Robots of a folder of tests.team.folders: in one process as a Team, and each by itself."""

import heapq
from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from tests.team.folders import pose

from mcloc.filters.catalog import Composition
from mcloc.geometry import between, compose
from mcloc.io.mrclam import Mrclam
from mcloc.localizer import Localizer
from mcloc.maps.landmarks import open_floor
from mcloc.maps.teammates import Teammates
from mcloc.team.detection import DetectionModel
from mcloc.team.joining import Joining
from mcloc.team.look_ahead import LookAhead
from mcloc.team.member import Member
from mcloc.team.peer_policy import PeerPolicy
from mcloc.team.policy import TeamPolicy
from mcloc.team.post import Post
from mcloc.team.remarks import silent
from mcloc.team.team import Team

FILTER = Composition(filter="mcl", size="fixed", settings={"size": {"particles": 500}})
MODEL = DetectionModel(sigma_range=0.1, sigma_bearing=0.03, range_max=6.0, particles=1000)
POLICY = TeamPolicy(window=4.0, distance=1.0)
QUICK = PeerPolicy(patience=600.0, silence=600.0, reply_wait=600.0, again=0.2, heartbeat=0.05)
"""Nothing is given up on a machine that is busy."""


def localizer(folder, robot, seed=0):
    """Robot 1 knows where it starts, and sees landmarks; the others know it roughly, and have
    wheels alone.
    """
    landmarks = Mrclam(str(folder), 1).landmarks
    return Localizer(
        open_floor(landmarks.places, 5.0, "floor"),
        FILTER,
        aids=(landmarks, Teammates()) if robot == 1 else (Teammates(),),
        seed=100 * seed + robot,
        initial=pose(robot, 0.0),
        initial_sigma=(0.1, 0.1, 0.1) if robot == 1 else (1.0, 1.0, 0.3),
    )


def events(folder, robot):
    return Mrclam(str(folder), robot).team_events(np.zeros(3), robot == 1)


def together(folder, robots=(1, 2), seed=0):
    """The Team, and the estimates of each robot."""
    team = Team({str(n): localizer(folder, n, seed) for n in robots}, MODEL, POLICY)
    found = {str(n): [] for n in robots}

    def stamped(n):
        return ((e.t, str(n), e) for e in events(folder, n))

    for _, name, event in heapq.merge(*map(stamped, robots), key=lambda of: of[0]):
        for owner, estimate in team.process(name, event):
            found[owner].append(estimate)
    for owner, estimate in team.finish():
        found[owner].append(estimate)
    return team, found


@dataclass
class Alone:
    """A robot that replays its log by itself, with what it found."""

    member: Member
    joining: Joining
    estimates: list
    ended: bool = False

    @property
    def dropped(self):
        return self.member.post.dropped

    def go(self, peers):
        for _ in self.joining.run(peers):
            self.estimates += self.member.taken()[0]
        self.ended = True


def alone(folder, robot, carrier, policy=QUICK, seed=0, log=None, model=MODEL, say=silent):
    """One of them. log: other events than those of the folder."""
    ahead = LookAhead(list(events(folder, robot)) if log is None else log)
    post = Post(str(robot), carrier, policy)
    member = Member(localizer(folder, robot, seed), post, model, POLICY, ahead.pop_wheels)
    return Alone(member, Joining(member, ahead, say), [])


def sound(particles):
    """Whether a belief is one."""
    finite = np.isfinite(particles.states).all() and not np.isnan(particles.log_weights).any()
    return finite and abs(particles.weights.sum() - 1.0) < 1e-9


def apart(one, other):
    """m: root mean square distance of two lists of estimates, at the stamps of the first: from
    those of the other before them, carried along the wheels.
    """
    stamps = [round(e.t, 3) for e in other]
    away = []
    for e in one:
        k = bisect_right(stamps, round(e.t, 3)) - 1
        if k >= 0:
            carried = compose(other[k].pose, between(other[k].odometry, e.odometry))
            away.append(e.pose[:2] - carried[:2])
    assert len(away) > 5
    return float(np.sqrt((np.array(away) ** 2).sum(axis=1).mean()))


def errors(found, robot):
    """m, of each estimate."""
    return np.array([np.hypot(*(e.pose[:2] - pose(robot, e.t - 1000.0)[:2])) for e in found])
