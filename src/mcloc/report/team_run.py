"""A team, from the first event of any of its robots to the last, in one process."""

import heapq
import secrets
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mcloc.config import RunConfig
from mcloc.errors import ConfigError, LogError
from mcloc.events import Detection, Event, Odometry
from mcloc.io.mrclam import Mrclam, is_mrclam, robots_in
from mcloc.kernels.jit import set_threads
from mcloc.localizer import Estimate, Localizer
from mcloc.maps.landmarks import Landmarks, open_floor
from mcloc.maps.teammates import Teammates
from mcloc.report.history import History
from mcloc.report.summary import accuracy_against, known
from mcloc.report.team import TOLD_SIGMA, TeamConfig, told_start_of, usual_detection
from mcloc.team.packed_tree import packed
from mcloc.team.team import PATIENCE, Team
from mcloc.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Member:
    """One robot of a team: its log, the truth about it, None without, what was found, and when it
    was told where it is (s).
    """

    log: Mrclam
    sees_landmarks: bool
    truth: Trajectory | None
    history: History = field(default_factory=History)
    told: list[float] = field(default_factory=list)


class TeamRun:
    """One run of a team: iterate over it once to make it; what it finds stays in it.

    members: by name. team: its state after the last event. message_bytes: how long each tree that
    was told is on the wire. Raises McLocError at once where the config, the landmarks or a truth
    cannot be right; LogError in the middle of a log that is cut, or at the end where no robot ever
    had a place.
    """

    def __init__(self, config: TeamConfig) -> None:
        robots = _robots(config)
        self.config = config
        self.seed = secrets.randbits(32) if config.seed is None else config.seed
        self.message_bytes: list[int] = []
        seeing = robots if config.landmarks_for is None else config.landmarks_for
        self.members: dict[str, Member] = {}
        localizers = {}
        for robot in robots:
            run, log = config.of_robot(robot, self.seed), Mrclam(config.data, robot)
            member = Member(log, robot in seeing, log.truth)
            localizers[str(robot)] = _localizer(run, member, config.told_start)
            self.members[str(robot)] = member
        model = config.of_team("detection", **usual_detection(run))
        self.team = Team(localizers, model, config.of_team("team"))
        if config.threads is not None:
            set_threads(config.threads)

    def __iter__(self) -> Iterator[Estimate]:
        logs = (_events(name, member) for name, member in self.members.items())
        for _, name, event in heapq.merge(*logs, key=lambda of: of[0]):
            if isinstance(event, Detection) and not self.config.detect:
                continue
            yield from self._noted(self.team.process(name, event))
            if isinstance(event, Odometry):
                self._carry(name, event.t - PATIENCE)
        yield from self._noted(self.team.finish())
        if not self.placed:
            raise LogError(
                f"{self.config.data}: no robot ever had a place: none saw landmarks that it knows "
                "of; name some with --landmarks-for, or say where they start with --told-start"
            )

    @property
    def placed(self) -> bool:
        """Whether any robot ever had a place."""
        return any(len(member.history) for member in self.members.values())

    def _carry(self, name: str, t: float) -> None:
        self.members[name].history.carry(self.team.robots[name], t)

    def _noted(self, estimates: list[tuple[str, Estimate]]) -> Iterator[Estimate]:
        for told in self.team.told:
            self.message_bytes.append(len(packed(told.tree)))
            self.members[told.robot].told.append(told.t)
        for name, estimate in estimates:
            self.members[name].history.add(estimate)
            yield estimate

    def summary(self) -> dict[str, Any]:
        """The accuracy of each robot, None where it never had a place or nobody knows the truth;
        how many detections were used, and how many not, by reason; how long messages are; the seed.
        """
        robots = {
            name: accuracy_against(member.truth, member.history).to_dict()
            if member.truth is not None and len(member.history)
            else None
            for name, member in self.members.items()
        }
        sizes = self.message_bytes
        told: dict[str, Any] = {
            "seed": self.seed,
            "robots": robots,
            "detections": {
                "used": self.team.used,
                "ignored": dict(sorted(self.team.ignored.items())),
            },
            "message_bytes": {
                "median": float(np.median(sizes)) if sizes else None,
                "max": max(sizes, default=None),
            },
        }
        return {key: known(value) for key, value in told.items()}


def _robots(config: TeamConfig) -> list[int]:
    """Those of the folder. Raises ConfigError where there are none, or others are asked for."""
    if not is_mrclam(config.data):
        raise ConfigError(
            f"{config.data}: is no MRCLAM folder, which has a Barcodes.dat and the logs of its "
            "robots"
        )
    robots = robots_in(config.data)
    if len(robots) < 2:
        raise ConfigError(f"{config.data}: holds the logs of {len(robots)} robots; a team has 2")
    for robot in config.landmarks_for or ():
        if robot not in robots:
            listed = ", ".join(map(str, robots))
            raise ConfigError(f"--landmarks-for: there is no robot {robot}, only {listed}")
    return robots


def _localizer(run: RunConfig, member: Member, told_start: bool) -> Localizer:
    """On a floor without walls, from which landmarks can be seen."""
    landmarks: Landmarks = member.log.landmarks
    grid = open_floor(
        landmarks.places, float(run.settings["sightings"]["range_max"]), landmarks.name
    )
    aids = (landmarks, Teammates()) if member.sees_landmarks else (Teammates(),)
    initial = told_start_of(member.log, member.truth) if told_start else None
    return Localizer(
        grid,
        run.composition,
        aids=aids,
        seed=run.seed,
        initial=initial,
        initial_sigma=TOLD_SIGMA,
        policy=run.policy,
    )


def _events(name: str, member: Member) -> Iterator[tuple[float, str, Event | Detection]]:
    """With their stamps, and whose they are."""
    for event in member.log.team_events(np.zeros(3), member.sees_landmarks):
        yield event.t, name, event
