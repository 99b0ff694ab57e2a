"""A study of a user's own: a log localized with every combination of some values of settings.

Each run is that of `mcloc run`: it tracks the robot from its true start, or searches for it from
one of several moments of the log on, or has it carried off now and then.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from mcloc.config import CHOICES, RunConfig, limited, merged
from mcloc.errors import ConfigError, TruthError
from mcloc.evaluation import evaluate
from mcloc.evaluation.convergence import recoveries
from mcloc.evaluation.errors import pose_errors, with_withheld
from mcloc.evaluation.kidnapping import find_kidnappings
from mcloc.events import Scan
from mcloc.experiments.table import Record, Setting, Value
from mcloc.io.bag_truth import read_truth
from mcloc.io.log import read_log
from mcloc.io.mrclam import Mrclam, is_mrclam
from mcloc.io.tum import read_trajectory
from mcloc.registry import suggest
from mcloc.report import Run
from mcloc.simulation.moments import GAP
from mcloc.simulation.teleports import teleported
from mcloc.trajectory import Trajectory

LEAST_LEFT = 15.0  # m of true path that a search has before it
BEFORE = 1e-3  # s: stamps of logs and references are printed with different digits
START = "start"  # the factor that says which moment a search begins at
NAMES = (*CHOICES, "particles")  # of what can be varied, beside parameters


@dataclass(frozen=True)
class Sweep:
    """What a user wants to know.

    entries: of a RunConfig with a truth; its start and end say which part of the log is used.
    assigned: {part: {parameter: value}} that are the same in all runs, whichever parts are varied.
    vary: {"sensor.sigma_hit": values}; names are those of `--set`, of parts, such as "sensor", or
    "particles". starts: moments of the log from which the robot is searched for; 0: it is tracked
    from its true start. teleports: chance per metre that it is carried off.
    """

    entries: Mapping[str, Any]
    assigned: Mapping[str, Mapping[str, Value]]
    vary: Mapping[str, Sequence[Value]]
    starts: int = 0
    teleports: float = 0.0

    def config(self, setting: Setting, seed: int | None = None) -> RunConfig:
        """The run of a setting, but for where it begins. Raises ConfigError."""
        entries: dict[str, Any] = {**self.entries, "threads": 1, "seed": seed, "initial": None}
        parts = {name: str(value) for name, value in setting.items() if name in CHOICES}
        entries = merged(merged(entries, parts), {"settings": self.assigned})
        settings: dict[str, dict[str, Value]] = {}
        for name, value in setting.items():
            part, dot, parameter = name.partition(".")
            if dot:
                settings.setdefault(part, {})[parameter] = value
        entries = merged(entries, {"settings": settings})
        if "particles" in setting:
            particles = setting["particles"]
            if not isinstance(particles, int):
                raise ConfigError(f"--vary particles: a whole number, got {particles!r}")
            entries = limited(entries, particles)
        return RunConfig(**{"map": None, **entries})


def run(sweep: Sweep, setting: Setting, seed: int) -> Record:
    """One run; its accuracy and speed."""
    made, truth = _begun(sweep, setting, seed)
    made.truth = truth
    kidnappings: tuple[float, ...] = ()
    if sweep.teleports:
        moved = teleported(made.log, truth, seed, per_metre=sweep.teleports)
        made.log, made.truth, kidnappings = moved, moved.truth, moved.kidnappings
    for _ in made:
        pass
    return _record(made, made.truth, kidnappings)


def _begun(sweep: Sweep, setting: Setting, seed: int | None = None) -> tuple[Run, Trajectory]:
    """A run before its first event, and the truth of the part of the log that is used."""
    config = sweep.config(setting, seed)
    truth = covered_truth(config)
    begun: dict[str, Any] = {"start": float(truth.t[0]) - BEFORE}
    if sweep.starts:
        begun["start"] = moments(truth, sweep.starts)[int(setting[START])] - BEFORE
    else:
        begun["initial"] = tuple(map(float, truth.poses[0]))
    return Run(replace(config, **begun)), truth


def _record(made: Run, truth: Trajectory, kidnappings: tuple[float, ...]) -> Record:
    history, wheels = made.history, made.history.wheels
    scans = float(wheels.t[0]), float(wheels.t[-1])
    accuracy = evaluate(
        history.trajectory, truth, odometry=wheels, kidnappings=kidnappings, scans=scans
    )
    whole = with_withheld(pose_errors(history.trajectory, truth), truth, scans)
    moved = find_kidnappings(whole.t, whole.reference, wheels, kidnappings)
    start, *others = recoveries(whole, moved)
    t, seconds, particles = history.updates.table.T
    # The first update of a process loads the kernels, or compiles them.
    took = made.wall_time - seconds[0] + np.median(seconds)
    return {
        "position_m": accuracy.position_median_m,
        "rmse_m": accuracy.position_rmse_m,
        "heading_deg": accuracy.heading_median_deg,
        "lost": accuracy.lost_fraction["1"],
        "converged": start.recovered,  # up to the first kidnapping, if the log holds one
        "converged_after_m": start.after_m,
        "withheld": history.share_withheld,
        "drawn": float(np.median(particles)),
        "update_ms": float(1e3 * np.median(seconds)),
        "realtime": float((t[-1] - t[0]) / took),
        "recoveries": [[r.path_m, r.after_m if r.recovered else None] for r in others],
    }


@lru_cache(maxsize=4)
def _read(path: str, topic: str | None) -> Trajectory:
    return read_trajectory(path) if topic is None else read_truth(path, topic)


def covered_truth(config: RunConfig) -> Trajectory:
    """The truth of the part of the log that is used, from the first to the last scan in it. Raises
    TruthError where it says nothing of that.
    """
    if "truth" in config.topics:
        truth = _read(config.log, config.topic("truth"))
    elif config.truth is not None:
        truth = _read(config.truth, None)
    elif is_mrclam(config.log) and (told := Mrclam(config.log, config.robot).truth) is not None:
        truth = told
    else:
        raise ConfigError("which truth? A sweep compares with one: give --truth FILE")
    topics = tuple(
        (role, (names,) if isinstance(names, str) else tuple(names))
        for role, names in config.sensor_topics.items()
    )
    first, last = _span(config.log, config.mount, topics, config.robot)
    begin = first if config.start is None else max(first, config.start)
    end = last if config.end is None else min(last, config.end)
    used = (truth.t >= begin - BEFORE) & (truth.t <= end + BEFORE)
    if not used.any():
        raise TruthError(
            f"the truth says nothing of the log: its stamps are {truth.t[0]:.3f} … "
            f"{truth.t[-1]:.3f} s, those of the scans {begin:.3f} … {end:.3f} s"
        )
    return Trajectory(truth.t[used], truth.poses[used])


@lru_cache(maxsize=4)
def _span(log: str, mount: Any, topics: Any, robot: int | None) -> tuple[float, float]:
    """Stamps of the first and the last scan of a log, of one without scans of any event."""
    named = {role: names[0] if len(names) == 1 else list(names) for role, names in topics}
    events = [(isinstance(e, Scan), e.t) for e in read_log(log, mount, named, robot)]
    stamps = [t for scan, t in events if scan] or [t for _, t in events]
    return min(stamps), max(stamps)


def moments(truth: Trajectory, n: int) -> list[float]:
    """n stamps of references, evenly spread over those that leave 15 m to drive. Raises TruthError
    where there are not so many.
    """
    steps = np.hypot(*np.diff(truth.poses[:, :2], axis=0).T)
    steps[steps > GAP] = 0.0  # nobody drove there
    left = steps.sum() - np.append(0.0, np.cumsum(steps))
    enough = np.flatnonzero(left >= LEAST_LEFT)
    if len(enough) < n:
        raise TruthError(
            f"--starts {n}: the truth is {steps.sum():.1f} m long, and {len(enough)} of its "
            f"{len(truth)} references leave {LEAST_LEFT:g} m to drive; ask for so many at most"
        )
    return [float(t) for t in truth.t[enough[np.linspace(0, len(enough) - 1, n).astype(int)]]]


def checked(sweep: Sweep) -> None:
    """Raises McLocError for what every run would raise: unknown names, values that cannot be, files
    that are missing or no map, log and truth, a truth that is too short; and for what contradicts
    itself.
    """
    if sweep.starts and sweep.teleports:
        raise ConfigError("--starts and --teleports exclude each other: give one of them")
    if not 0.0 <= sweep.teleports < 1.0:
        raise ConfigError(f"--teleports is a chance per metre, 0 to below 1, got {sweep.teleports}")
    for name in sweep.vary:
        if "." not in name and name not in NAMES:
            raise ConfigError(f"--vary: unknown name {name!r}; {suggest(name, NAMES)}")
    fixed = {f"{part}.{name}" for part, values in sweep.assigned.items() for name in values}
    both = fixed & set(sweep.vary)
    if "particles" in sweep.vary:
        both |= {"size.particles", "size.maximum"} & (fixed | set(sweep.vary))
    if both:
        raise ConfigError(f"{', '.join(sorted(both))} is given twice: vary it, or set it")
    for values in itertools.product(*sweep.vary.values()):
        _begun(sweep, {**dict(zip(sweep.vary, values, strict=True)), START: 0})


def inputs(sweep: Sweep) -> list[Path]:
    """The files that its runs read."""
    named = [sweep.entries.get(name) for name in ("map", "log", "truth")]
    found = [Path(path) for path in named if path is not None]
    return [f for path in found for f in (sorted(path.rglob("*")) if path.is_dir() else [path])]
