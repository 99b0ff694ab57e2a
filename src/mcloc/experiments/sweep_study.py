"""A sweep as a study: what its tables and its picture show."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mcloc.errors import ConfigError
from mcloc.evaluation.convergence import Recovery
from mcloc.evaluation.survival import Survival
from mcloc.experiments.study import Study
from mcloc.experiments.sweep import START, Sweep, inputs, run
from mcloc.experiments.table import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FOUND_WITHIN = 20.0  # m


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
    "withheld": "share of scans without a pose",
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
        pooled=pooled,
        over=(START,) if sweep.starts else (),
        inputs=partial(inputs, sweep),
        base=repr(replace(sweep, vary={})),
        command=command,
    )


ABOUT = """
Errors are those of `mcloc eval`: at each stamp of the truth, in the map frame, without alignment,
from the first to the last pose that a filter told. *Converged*: off by less than 0.5 m and 10° from
some moment on, to the end, counted from the first scan. Speed is that of one
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
