"""A team that is to be replayed: what its robots are, and how well they see each other."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mcloc.config import RunConfig
from mcloc.config.run_config import PARTS
from mcloc.config.typed import typed
from mcloc.draws import check_seed
from mcloc.errors import ConfigError
from mcloc.geometry import Pose
from mcloc.io.mrclam import Mrclam
from mcloc.registry import Configurable, ParameterError, Value, named, suggest
from mcloc.team.detection import DetectionModel
from mcloc.team.policy import TeamPolicy
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
