"""A team, from the first event of any of its robots to the last, in one process."""

import heapq
import math
import secrets
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mcloc.config import RunConfig
from mcloc.config.run_config import PARTS
from mcloc.config.typed import typed
from mcloc.draws import check_seed
from mcloc.errors import ConfigError, LogError
from mcloc.events import Detection, Event, Odometry
from mcloc.geometry import Pose
from mcloc.io.mrclam import Mrclam, is_mrclam, robots_in
from mcloc.kernels.jit import set_threads
from mcloc.localizer import Estimate, Localizer
from mcloc.maps.landmarks import Landmarks, open_floor
from mcloc.maps.teammates import Teammates
from mcloc.registry import Configurable, ParameterError, Value, named, suggest
from mcloc.report.history import History
from mcloc.report.summary import accuracy_against, known
from mcloc.team.detection import DetectionModel
from mcloc.team.packed_tree import packed
from mcloc.team.policy import TeamPolicy
from mcloc.team.team import PATIENCE, Team
from mcloc.trajectory import Trajectory

TOLD_SIGMA = (0.05, 0.05, 0.02)  # m, m, rad: how well a start pose is told
OF_TEAM: Mapping[str, type[Configurable]] = {"detection": DetectionModel, "team": TeamPolicy}
"""What has parameters to set besides the parts of a run."""

_CAMERA = {
    **{name: name for name in ("sigma_range", "sigma_relative", "sigma_bearing", "range_max")},
    "p_false": "p_outlier",
}
"""What a camera does with robots that it sees, and by which parameter of sightings that is told."""


@dataclass(frozen=True)
class TeamConfig:
    """A team that is to be replayed.

    data: an MRCLAM folder. landmarks_for: which robots are told of the landmarks that they see, all
    for None. told_start: whether they know where they start, by the truth, to TOLD_SIGMA. detect:
    whether robots that see each other are told. parts: {kind: name} of the filters, as of a
    RunConfig. settings: {part: {parameter: value}}, as there, and of OF_TEAM. Of a detection that
    is not set is taken what the camera does with landmarks. seed: None for a fresh one. Raises
    ConfigError for what cannot be one.
    """

    data: str
    landmarks_for: Sequence[int] | None = None
    told_start: bool = False
    detect: bool = True
    parts: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    seed: int | None = None
    threads: int | None = None

    def __post_init__(self) -> None:
        if self.seed is not None:
            check_seed(self.seed)
        known = {*PARTS, *OF_TEAM}
        for part in self.settings:
            if part not in known:
                raise ConfigError(f"unknown part {part!r}; {suggest(part, known)}")

    def of_robot(self, robot: int, seed: int) -> RunConfig:
        """How one of them is localized."""
        settings = {part: of for part, of in self.settings.items() if part not in OF_TEAM}
        run = RunConfig(
            None,
            self.data,
            robot=robot,
            seed=(seed + robot) % 2**64,
            threads=self.threads,
            settings=settings,
            **self.parts,  # type: ignore[arg-type]
        )
        return run.resolved()

    def of_team(self, part: str, **usual: Value) -> Any:
        """The detection model or the policy. usual: what is other than its defaults."""
        return made(part, OF_TEAM[part], self.settings, usual)


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


def made(
    part: str,
    kind: type[Configurable],
    settings: Mapping[str, Mapping[str, Value]],
    usual: Mapping[str, Value] | None = None,
) -> Any:
    """A part of that kind by its settings. usual: what is other than its defaults."""
    own = typed(part, kind, settings.get(part, {}))
    try:
        with named(part):
            return kind(**{**(usual or {}), **own})
    except ParameterError as error:
        name = error.fault.split()[0]
        if name in own:
            raise
        raise ConfigError(f"sightings.{_CAMERA[name]}: by it {error}; set that, too") from None


def usual_detection(run: RunConfig) -> dict[str, Value]:
    """How well robots see each other with the camera that sees landmarks."""
    camera = run.settings["sightings"]
    usual = {name: camera[of] for name, of in _CAMERA.items()}
    return {**usual, "p_false": 1.0 - (1.0 - float(usual["p_false"])) ** 2}


def told_start_of(log: Mrclam, truth: Trajectory | None) -> Pose:
    """(3,): where a robot is at its first odometry, by the truth. Raises ConfigError without."""
    if truth is None:
        raise ConfigError(
            f"{log.folder}: nobody knows where robot {log.robot} starts: there is no "
            f"Robot{log.robot}_Groundtruth.dat"
        )
    first = next((e.t for e in log.odometry(Counter()) if math.isfinite(e.t)), 0.0)
    start: Pose = truth.at(np.array([first]))[0]
    return start


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
