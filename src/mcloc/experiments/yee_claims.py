"""How the claims of E15 to E17 are decided: means over the paths of a seed, and what depends on the
number of samples  [Yee §5].
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcloc.evaluation.intervals import LEVEL, Interval, mean, paired_difference, paired_ratio
from mcloc.experiments.comparisons import graded
from mcloc.experiments.study import Finding, Verdict
from mcloc.experiments.table import Setting, Table, Value
from mcloc.experiments.yee_runs import FEW, LOST, MCL, RENEWING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ALIKE = {"lost": 0.05, "lost_told": 0.05, "error_m": 0.05}
"""How far apart it may be with two numbers of samples to be "virtually independent" of them."""
AS_MUCH = 0.6
COUNTS = {"lost": "withheld ones lost", "lost_told": "withheld ones left out"}


def by_seed(table: Table, metric: str, *settings: Setting) -> list[NDArray[np.float64]]:
    """(seeds,) of each setting: the mean over the paths of a seed, of those where it is known.
    Seeds of which a run raised, or of which nothing is known, are left out of all.
    """
    found: list[dict[int, float]] = []
    for setting in settings:
        rows = table.where(**setting).rows
        raised = {row.seed for row in rows if row.record is None}
        known: dict[int, list[float]] = {}
        for row in rows:
            if row.record is not None and row.record[metric] is not None:
                known.setdefault(row.seed, []).append(float(row.record[metric]))
        found.append({seed: float(np.mean(v)) for seed, v in known.items() if seed not in raised})
    seeds = sorted(set.intersection(*map(set, found)))
    return [np.array([of[seed] for seed in seeds]) for of in found]


@dataclass(frozen=True)
class Alike:
    """What differs between two numbers of samples. margin: how far it may be apart."""

    metric: str
    samples: Value
    apart: Interval
    margin: float

    @property
    def holds(self) -> bool:
        return -self.margin < self.apart.low and self.apart.high < self.margin

    @property
    def most(self) -> float:
        return max(abs(self.apart.low), abs(self.apart.high)) / self.margin


def sizes_of(table: Table) -> list[int]:
    """The numbers of samples, smallest first."""
    return sorted(int(n) for n in table.values("samples"))


def flat(table: Table) -> Finding:
    """Loss rate and error with each number of samples are virtually those with the largest."""
    sizes = sizes_of(table)
    settings: list[Setting] = [{"method": RENEWING, "samples": n} for n in sizes]
    level = 1.0 - (1.0 - LEVEL) / (len(ALIKE) * (len(sizes) - 1))
    found = []
    for metric, margin in ALIKE.items():
        *others, largest = by_seed(table, metric, *settings)
        found += [
            Alike(metric, n, paired_difference(values, largest, level), margin)
            for n, values in zip(sizes, others, strict=False)
        ]
    most = {name: max((a for a in found if a.metric == name), key=_most) for name in ALIKE}
    told = most["lost"]
    error = scaled(most["error_m"].apart, 100.0)
    return Finding(
        graded([a.holds for a in found]),
        f"percentage points of scans lost more with {told.samples:,} samples than with "
        f"{sizes[-1]:,}, the most (the interval holds for all of them at once)",
        scaled(told.apart, 100.0),
        f"Withheld ones left out: {scaled(most['lost_told'].apart, 100.0)} "
        f"({most['lost_told'].samples:,}); centimetres of error: {error} "
        f"({most['error_m'].samples:,}). Within the margin in {sum(a.holds for a in found)} of "
        f"{len(found)} comparisons.",
    )


def less_with_few(table: Table) -> Finding:
    """With 100 samples it loses less than MCL, by 60 % or more, however withheld ones count."""
    found = {}
    for metric in COUNTS:
        ours, theirs = (
            by_seed(table, metric, {"method": m, "samples": FEW})[0] for m in (RENEWING, MCL)
        )
        found[metric] = _less(ours, theirs)
    if all(less.low >= 100.0 * AS_MUCH for less in found.values()):
        verdict = Verdict.REPRODUCED
    else:
        some = any(less.low > 0.0 for less in found.values())
        verdict = Verdict.IN_PART if some else Verdict.NOT
    return Finding(
        verdict,
        f"percent lost less than by {MCL}, {FEW} samples, {COUNTS['lost']}",
        found["lost"],
        f"With {COUNTS['lost_told']}: {found['lost_told']}.",
    )


def _less(ours: NDArray[np.float64], theirs: NDArray[np.float64]) -> Interval:
    """By how many percent; nothing is known where the other loses nothing."""
    if theirs.max() == 0.0:
        return Interval(math.nan, math.nan, math.nan)
    ratio = paired_ratio(ours, theirs)
    return Interval(*(100.0 * (1.0 - x) for x in (ratio.value, ratio.high, ratio.low)))


def draw_curves(loss: "Axes", error: "Axes", table: Table, styles: Mapping[str, str]) -> None:
    """Loss rate and error over the number of samples, as in the paper. styles: {method: color}."""
    sizes = sizes_of(table)
    for method, color in styles.items():
        for axes, metric, line in (
            (loss, "lost", "o-"),
            (loss, "lost_told", "s:"),
            (error, "error_m", "o-"),
        ):
            if metric == "lost_told" and method != RENEWING:
                continue  # nothing is withheld
            curve = [
                _mean(table.where(method=method, samples=n).column(metric), 100.0) for n in sizes
            ]
            value, low, high = np.array([(i.value, i.low, i.high) for i in curve]).T
            label = f"{method}, {COUNTS[metric]}" if metric == "lost_told" else method
            bars = np.maximum((value - low, high - value), 0.0)
            axes.errorbar(sizes, value, bars, fmt=line, color=color, label=label, ms=4, capsize=2)
    loss.set(xscale="log", xlabel="samples", ylabel=f"share of scans > {LOST:g} m off [%]")
    loss.set_yscale("symlog", linthresh=0.1, linscale=0.3)
    loss.set_ylim(0.0, 110.0)
    loss.set_yticks((0, 0.1, 1, 10, 100), ("0", "0.1", "1", "10", "100"))
    error.set(xscale="log", xlabel="samples", ylabel="error of the others [cm]", ylim=(0.0, None))
    for axes in (loss, error):
        axes.grid(alpha=0.3)


def _mean(values: NDArray[np.float64], scale: float) -> Interval:
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return Interval(math.nan, math.nan, math.nan)
    return scaled(mean(known), scale)


def scaled(interval: Interval, scale: float) -> Interval:
    """In another unit, such as percent."""
    return Interval(scale * interval.value, scale * interval.low, scale * interval.high)


def _most(alike: Alike) -> float:
    return alike.most
