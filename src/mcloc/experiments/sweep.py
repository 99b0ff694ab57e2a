"""A study of a user's own: a log localized with every combination of some values of settings.

Each run is that of `mcloc run`: it tracks the robot from its true start, or searches for it from
one of several moments of the log on, or has it carried off now and then.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mcloc.config import CHOICES, RunConfig, limited, merged
from mcloc.errors import ConfigError, TruthError
from mcloc.evaluation import Accuracy, evaluate
from mcloc.evaluation.convergence import Recovery
from mcloc.evaluation.survival import Survival
from mcloc.experiments.study import Study
from mcloc.experiments.table import Record, Setting, Table, Value
from mcloc.io.bag_truth import read_truth
from mcloc.io.tum import read_trajectory
from mcloc.maps.occupancy import FREE, OccupancyGrid
from mcloc.registry import suggest
from mcloc.report import Run
from mcloc.simulation.teleports import teleported
from mcloc.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEAST_LEFT = 15.0  # m of true path that a search has before it
FOUND_WITHIN = 20.0  # m
BEFORE = 1e-3  # s: stamps of logs and references are printed with different digits
START = "start"  # the factor that says which moment a search begins at
NAMES = ("filter", *CHOICES, "particles")  # of what can be varied, beside parameters


@dataclass(frozen=True)
class Sweep:
    """What a user wants to know.

    entries: of a RunConfig with a truth. vary: {"sensor.sigma_hit": values}; names are those of
    `--set`, of parts, such as "sensor", or "particles". starts: moments of the log from which the
    robot is searched for; 0: it is tracked from its true start. teleports: chance per metre that
    it is carried off.
    """

    entries: Mapping[str, Any]
    vary: Mapping[str, Sequence[Value]]
    starts: int = 0
    teleports: float = 0.0

    def config(self, setting: Setting, seed: int | None = None) -> RunConfig:
        """The run of a setting, but for where it begins. Raises ConfigError."""
        entries: dict[str, Any] = {**self.entries, "threads": 1, "seed": seed}
        settings: dict[str, dict[str, Value]] = {}
        particles = None
        for name, value in setting.items():
            part, dot, parameter = name.partition(".")
            if name == "particles":
                particles = value
            elif dot:
                settings.setdefault(part, {})[parameter] = value
            elif name in NAMES:
                entries = merged(entries, {name: str(value)})
            elif name != START:
                raise ConfigError(f"--vary: unknown name {name!r}; {suggest(name, NAMES)}")
        entries = merged(entries, {"settings": settings})
        if particles is not None:
            if not isinstance(particles, int):
                raise ConfigError(f"--vary particles: a whole number, got {particles!r}")
            entries = limited(entries, particles)
        return RunConfig(**{"map": None, **entries})


def run(sweep: Sweep, setting: Setting, seed: int) -> Record:
    """One run; its accuracy and speed."""
    config = sweep.config(setting, seed)
    truth = _truth(config)
    begun: dict[str, Any]
    if sweep.starts:
        at = moments(truth, sweep.starts)[int(setting[START])]
        begun = {"start": at - BEFORE, "initial": None}
    else:
        pose = tuple(map(float, truth.poses[0]))
        begun = {"start": float(truth.t[0]) - BEFORE, "initial": pose}
    made = Run(RunConfig(**{**_entries(config), **begun}))
    kidnappings: tuple[float, ...] = ()
    if sweep.teleports:
        moved = teleported(made.log, truth, seed, per_metre=sweep.teleports)
        made.log, made.truth, kidnappings = moved, moved.truth, moved.kidnappings
    for _ in made:
        pass
    assert made.truth is not None
    history = made.history
    accuracy = evaluate(
        history.trajectory, made.truth, odometry=history.wheels, kidnappings=kidnappings
    )
    t, seconds, particles = history.updates.table.T
    return {
        **_measured(accuracy),
        "drawn": float(np.median(particles)),
        "update_ms": float(1e3 * np.median(seconds)),
        "realtime": float((t[-1] - t[0]) / made.wall_time),
        "recoveries": [[r.path_m, r.after_m if r.recovered else None] for r in accuracy.recoveries],
    }


def _entries(config: RunConfig) -> dict[str, Any]:
    return {f.name: getattr(config, f.name) for f in fields(config)}


def _measured(accuracy: Accuracy) -> dict[str, Any]:
    return {
        "position_m": accuracy.position_median_m,
        "rmse_m": accuracy.position_rmse_m,
        "heading_deg": accuracy.heading_median_deg,
        "lost": accuracy.lost_fraction["1"],
        "converged": accuracy.converged,
        "converged_after_m": accuracy.distance_to_converge_m,
    }


@lru_cache(maxsize=4)
def _read(path: str, topic: str | None) -> Trajectory:
    return read_trajectory(path) if topic is None else read_truth(path, topic)


def _truth(config: RunConfig) -> Trajectory:
    if "truth" in config.topics:
        return _read(config.log, config.topic("truth"))
    if config.truth is None:
        raise ConfigError("which truth? A sweep compares with one: give --truth FILE")
    return _read(config.truth, None)


def moments(truth: Trajectory, n: int) -> list[float]:
    """n stamps of references, evenly spread over those that leave 15 m to drive. Raises TruthError
    where there are none.
    """
    steps = np.hypot(*np.diff(truth.poses[:, :2], axis=0).T)
    left = steps.sum() - np.append(0.0, np.cumsum(steps))
    enough = np.flatnonzero(left >= LEAST_LEFT)
    if not len(enough):
        raise TruthError(
            f"the truth is {steps.sum():.1f} m long; searches need {LEAST_LEFT:g} m: leave out "
            "--starts"
        )
    return [float(t) for t in truth.t[np.linspace(0, enough[-1], n).astype(int)]]


def checked(sweep: Sweep) -> None:
    """Raises McLocError for what every run would raise: unknown names, values that cannot be, files
    that are missing or no map, log and truth, a truth that is too short.
    """
    if sweep.starts and sweep.teleports:
        raise ConfigError("--starts and --teleports exclude each other: give one of them")
    if not 0.0 <= sweep.teleports < 1.0:
        raise ConfigError(f"--teleports is a chance per metre, 0 to below 1, got {sweep.teleports}")
    free = OccupancyGrid(np.full((9, 9), FREE, dtype=np.int8), 0.1, np.zeros(3), name="map")
    for setting in study(sweep, 1, "").settings():
        config = sweep.config(setting)
        # Values out of range are found where parts are built, on whatever map.
        _ = config.composition.build(free), config.policy, config.replay_pace
    truth = _truth(config)
    Run(config)
    if sweep.starts:
        moments(truth, sweep.starts)


def found(rows: Table) -> str:
    """The share of kidnapped robots that is found within 20 m, by Kaplan and Meier."""
    recoveries = [
        Recovery(0.0, after is not None, path, after_m=after)
        for record in rows.records()
        for path, after in record["recoveries"]
    ]
    try:
        return str(Survival.of(recoveries).within(FOUND_WITHIN))
    except ConfigError:  # none was carried off with enough way before it
        return "–"


METRICS = {
    "position_m": "median position error, m",
    "rmse_m": "position RMSE, m",
    "heading_deg": "median heading error, °",
    "lost": "share of time > 1 m off",
    "drawn": "median particles",
    "update_ms": "update, ms",
    "realtime": "× real time",
}
SEARCHED = {"converged": "converged", "converged_after_m": "after, m"}


def study(sweep: Sweep, seeds: int, command: str) -> Study:
    """The sweep as a study. command: which runs it."""
    factors = dict(sweep.vary)
    if sweep.starts:
        factors[START] = tuple(range(sweep.starts))
    pooled: dict[str, Callable[[Table], str]] = {}
    if sweep.teleports:
        pooled[f"found within {FOUND_WITHIN:g} m"] = found
    return Study(
        number="sweep",
        title=f"{', '.join(sweep.vary)} on {sweep.entries['log']}",
        source=_how(sweep),
        about=ABOUT,
        factors=factors,
        run=partial(run, sweep),
        metrics={**(SEARCHED if sweep.starts else {}), **METRICS},
        claims=(),
        draw=draw,
        seeds=seeds,
        timed=("update_ms", "realtime"),
        pooled=pooled,
        over=(START,) if sweep.starts else (),
        command=command,
    )


ABOUT = """
Errors are those of `mcloc eval`: at each stamp of the truth, in the map frame, without alignment.
*Converged*: off by less than 0.5 m and 10° from some moment on, to the end. Speed is that of one
thread on the machine, or machines, that made the runs. Runs of one start are not independent of
each other, and no more are seeds of the same log: an interval tells how sure the figure is for this
log, not for others.
"""


def _how(sweep: Sweep) -> str:
    if sweep.starts:
        return f"Searched for on the whole map from {sweep.starts} moments of the log on"
    if sweep.teleports:
        return f"Tracked from the true start, carried off with p = {sweep.teleports:g} per metre"
    return "Tracked from the true start"


def draw(table: Table, figure: "Figure") -> None:
    """Accuracy, success and speed over the first factor; the other factors are curves."""
    factors = [name for name in table.rows[0].setting if name != START]
    panels = {
        "position_m": "median position error [m]",
        "converged": "share of runs that converged",
        "lost": "share of time > 1 m off",
        "update_ms": "update [ms]",
    }
    first, others = factors[0], factors[1:]
    values = table.values(first)
    numeric = all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
    x = [float(v) for v in values] if numeric else list(range(len(values)))
    settings = {tuple((name, row.setting[name]) for name in others) for row in table.rows}
    for axes, (metric, label) in zip(figure.subplots(2, 2).flat, panels.items(), strict=True):
        for setting in sorted(settings, key=str):
            curve = [
                table.where(**dict(setting), **{first: value}).column(metric) for value in values
            ]
            middle = [float(np.nanmean(v)) if np.isfinite(v).any() else np.nan for v in curve]
            label_of = ", ".join(f"{name} = {value}" for name, value in setting)
            (line,) = axes.plot(x, middle, "o-", ms=4, lw=1.5, label=label_of)
            for at, v in zip(x, curve, strict=True):
                axes.plot(np.full(len(v), at), v, ".", ms=3, alpha=0.35, color=line.get_color())
        axes.set(xlabel=first, ylabel=label, ylim=(0.0, None))
        if not numeric:
            axes.set_xticks(x, [str(v) for v in values])
        elif min(x) > 0.0 and max(x) > 8.0 * min(x):
            axes.set_xscale("log")
        axes.grid(alpha=0.3)
    if others:
        handles = figure.axes[0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside upper center", ncols=3, frameon=False)
