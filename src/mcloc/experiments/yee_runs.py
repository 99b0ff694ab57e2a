"""The filters of E15 and E16, what is measured of a run, and how their claims are decided  [Yee
§5].
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from mcloc.evaluation.intervals import LEVEL, Interval, mean, paired_difference, paired_ratio
from mcloc.experiments.comparisons import graded
from mcloc.experiments.driving import EVERY_SCAN, localized
from mcloc.experiments.places import Drive
from mcloc.experiments.study import Finding, Verdict
from mcloc.experiments.table import Record, Setting, Table, Value
from mcloc.experiments.yee_world import SENSOR
from mcloc.filters.catalog import Composition

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZES = (100, 300, 1000, 3000, 10_000, 30_000, 100_000)
FEW = SIZES[0]
SWEPT = (100, 1000)  # samples with which other parameters are tried
LOST = 0.5  # m
STEADY = 10  # scans, 1.5 m of driving, after which a robot counts as found again
MCL, RANDOM, RENEWING = "MCL", "MCL with 5 % random", "MCL with re-initialisation"
SPACING = 0.2  # m, by the rule of E17
THRESHOLD, MOST, RATE, COLLAPSED, ALPHA = 0.2, 0.5, 0.3, 2.0 * LOST, 0.01
OTHER_THRESHOLDS = {
    f"{RENEWING}, threshold {value}": value for value in (0.5 * THRESHOLD, 2.0 * THRESHOLD)
}
SHARES = {MCL: 0.0, RANDOM: 0.05, **{f"MCL with {s} % random": s / 100.0 for s in (1, 20, 50)}}
ALIKE = {"lost": 0.05, "lost_told": 0.05, "error_m": 0.05}
"""How far apart it may be with two numbers of samples to be "virtually independent" of them."""
AS_MUCH = 0.6
COUNTS = {"lost": "withheld ones lost", "lost_told": "withheld ones left out"}

FILTERS = f"""
- The figure is the share of scans at which the estimate is more than {LOST:g} m off. Where the
  filter withholds its estimate, that is counted in both ways: as lost, and left out. A run that
  never tells a pose counts as lost throughout in both. The position error is that of the other
  scans.
- *{MCL}* starts with samples all over the floor, as many as it goes on with, and has no random
  ones. *{RENEWING}* is mcloc's `grid-proposal`. The estimate of all filters is the mean of the
  largest mode, not of all samples. Each scan is used, and counts in full.
- Its q(x | z) is that of mcloc's `grid-match`, with defaults that were found on recorded logs, not
  here. It differs from the paper's: a component's weight is the mean of p(z | x) over 8 poses
  around its point, where the paper has p(z | μ_i); deviations are 0.4 of the spacing in the plane,
  and 1.6° in heading at any spacing; and a tenth of q is uniform, which bounds the weights.
- What the paper leaves out was chosen once, with six runs a path of seeds that are not the study's:
  - α = {ALPHA:g}: a robot that is kidnapped once in a run of some 120 scans.
  - The maximum likelihood is that of a reading: the highest p(z | x)^(1/16) of a sample, relative
    to a perfect reading. Its moving average takes a new one at a rate of {RATE:g}, and so looks
    back on three scans or so.
  - Its threshold is {THRESHOLD:g}. With 100 samples the average of a tracked robot was below in 1
    of 100 steps; that of a lost one was below 0.06 in 99 of 100. Half and twice as much are tried
    with {SWEPT[0]} and {SWEPT[1]:,} samples.
  - φ is {MOST:g} at most, so that half of the samples go on, and it reaches that where the average
    is 0: κ = {MOST:g} / {THRESHOLD:g}.
  - Samples have collapsed to a cluster where their rectangle has a diagonal below
    {COLLAPSED:g} m: then all of them are within {LOST:g} m of its middle. That of tracked robots
    was below 0.4 m.
  - The grid has a point each {SPACING:g} m, by the rule of E17.
"""


def composition(method: str, samples: int, spacing: float = SPACING) -> Composition:
    """One of the methods with so many samples."""
    if method in SHARES:
        return Composition(
            "mcl",
            sensor="beam-yee",
            size="fixed",
            recovery="random",
            settings={
                "sensor": SENSOR,
                "size": {"particles": samples},
                "recovery": {"share": SHARES[method], "doubt_below": 0.0},
            },
        )
    threshold = {RENEWING: THRESHOLD, **OTHER_THRESHOLDS}[method]
    chosen = {
        "particles": samples,
        "spacing": spacing,
        "alpha": ALPHA,
        "threshold": threshold,
        "gain": MOST / threshold,
        "most": MOST,
        "rate": RATE,
        "collapsed": COLLAPSED,
    }
    return Composition(
        "grid-proposal", sensor="beam-yee", settings={"sensor": SENSOR, "filter": chosen}
    )


def tracked(
    drive: Drive, filter: Composition, seed: int
) -> tuple[NDArray[np.float64], float | None]:
    """(T,): metres that the estimate is off at each scan of a robot that may be anywhere at first,
    NaN where it is withheld; and the median of milliseconds an update that told one.
    """
    history = localized(drive, filter, seed, policy=EVERY_SCAN)
    errors = np.full(len(drive.truth), np.nan)
    if len(history):
        at = np.searchsorted(drive.truth.t, history.column("t") - 1e-6)
        apart = history.trajectory.poses[:, :2] - drive.truth.poses[at, :2]
        errors[at] = np.hypot(apart[:, 0], apart[:, 1])
    took = history.updates.table[:, 1]
    return errors, 1e3 * float(np.median(took)) if len(took) else None


def measured(errors: NDArray[np.float64]) -> Record:
    """What of a run is told in tables; errors: as `tracked` has them."""
    told = np.isfinite(errors)
    near = errors <= LOST
    off = float(np.mean(errors[told] > LOST)) if told.any() else 1.0
    return {
        "lost": float(np.mean(~near)),
        "lost_told": off,
        "withheld": float(np.mean(~told)),
        "error_m": float(np.mean(errors[near])) if near.any() else None,
    }


@dataclass(frozen=True)
class Recovery:
    """What became of a kidnapped robot. after: seconds to the first of STEADY scans in a row with
    an estimate that is near, None where there are none; left: seconds to the end of the run.
    """

    after: float | None
    left: float

    @property
    def waited(self) -> float:
        """Seconds; all that were left, where it was not found."""
        return self.left if self.after is None else self.after


def recovery(drive: Drive, errors: NDArray[np.float64]) -> Recovery:
    """Of a robot that is carried once; errors: as `tracked` has them."""
    steps = np.hypot(*np.diff(drive.truth.poses[:, :2], axis=0).T)
    at = int(np.argmax(steps)) + 1
    near = sliding_window_view(errors[at:] <= LOST, STEADY).all(axis=1)
    t = drive.truth.t[at:] - drive.truth.t[at - 1]
    return Recovery(float(t[np.argmax(near)]) if near.any() else None, float(t[-1]))


METRICS = {
    "lost": "share of scans > 0.5 m off, withheld ones as lost",
    "lost_told": "the same, withheld ones left out",
    "withheld": "share of scans withheld",
    "error_m": "mean error of the others, m",
    "update_ms": "median ms an update",
}


def applies(setting: Setting) -> bool:
    """Other parameters are tried with few numbers of samples."""
    return setting["method"] in (MCL, RANDOM, RENEWING) or setting["samples"] in SWEPT


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
