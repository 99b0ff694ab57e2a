"""E9: MCL with a mixture of proposals over the noise of the sensor [Fox01 §19.3.3, Fig. 19.10]."""

from typing import TYPE_CHECKING

import numpy as np

from mcloc.evaluation.intervals import Interval, mean, paired_ratio
from mcloc.experiments.comparisons import Comparison, compared, graded, listed, ratios, told
from mcloc.experiments.object_in_space import (
    FILTERS,
    NOISES,
    WORLD,
    draw_curve,
    errors,
    finish_axes,
    localized,
    pairs,
    percent,
)
from mcloc.experiments.study import Claim, Finding, Study, Verdict
from mcloc.experiments.table import Record, Setting, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAMPLES = 1000
MOVED_MM = (1, 10)
FORWARD, PAIRS = "mixture, approach 2", "mixture, approach 1"
OTHERS = ("mixture, resampled", FORWARD)
TEN = 10.0  # times: an order of magnitude
ALIKE = 1.25  # times: what differs by less is as good

ABOUT = f"""
Samples come from the camera's ray (its *dual* proposal), 10 % of them in a *mixture*, the others
from MCL's proposal; 1,000 in all. E8 shows MCL alone in the same world.
{WORLD}
- Dual samples are weighed by approach 3, which is the paper's, with density trees of the weighted
  set; or by the approach that the filter's name tells. Each proposal keeps its share of the belief.
- *resampled*: the paper does not say whether the tree is of weighted samples. Leaves hold a number
  of samples; those of a weighted set are as small where samples weigh nothing as where they weigh
  much. These filters make the tree of a resampled set instead. They were added when 12 runs, of
  seeds that are not the study's, had shown approach 2, which has such a set, to be better. So no
  claim is decided with them; what they would say is told.
- *moved_mm*: with 1 mm, MCL's error over the noise is U-shaped as in the paper, with 10 mm it is
  not (E8). Approach 1 is tried with 1 mm alone.
- Zero weights are those below 1e-12 of the largest among a step's dual samples, from the second
  step on. The largest is never one of them: with 100 dual samples the share is 0.99 where all
  others are. "Times faster than real time" is by the processor's clock, one thread, if a step takes
  0.2 s, the time between the paper's images; it differs from machine to machine.

The rules were fixed before those 12 runs of each filter, the predictions written after them.
"""


def run(setting: Setting, seed: int) -> Record:
    """One drive with one filter."""
    moved, noise = 1e-3 * float(setting["moved_mm"]), float(setting["noise"])
    return localized(str(setting["filter"]), SAMPLES, noise, moved, seed)


def applies(setting: Setting) -> bool:
    """Approach 1 with 1 mm alone."""
    return setting["filter"] != PAIRS or setting["moved_mm"] == MOVED_MM[0]


def against(table: Table, a: str, b: str) -> list[Comparison]:
    """The error of one filter to that of another, at each noise and error of the wheels."""
    return compared(pairs(table, {"filter": a}, {"filter": b}))


def better(table: Table) -> Finding:
    """The mixture's error is below MCL's, everywhere."""
    found = against(table, "MCL", "mixture")
    least = min(found, key=lambda c: c.ratio.value)
    others = "; ".join(
        f"{name}: better in {sum(c.above for c in rest)}, worse in {sum(c.below for c in rest)}"
        for name in OTHERS
        for rest in [against(table, "MCL", name)]
    )
    return Finding(
        graded([c.above for c in found]),
        f"the error of MCL to that of the mixture, the lowest ({least.told})",
        least.ratio,
        f"All: {listed(found)}. The mixture is better in {sum(c.above for c in found)} of "
        f"{len(found)} comparisons, worse in {sum(c.below for c in found)}. {others}.",
    )


def tenfold(table: Table) -> Finding:
    """The largest ratio of MCL's error to the mixture's, with an interval for all of them."""
    where, ratio = widest(table, "mixture")
    others = "; ".join(f"{name}, {w}: {r}" for name in OTHERS for w, r in [widest(table, name)])
    verdict = (
        Verdict.REPRODUCED
        if ratio.low > TEN
        else Verdict.IN_PART
        if ratio.value > TEN
        else Verdict.NOT
    )
    return Finding(
        verdict,
        f"the error of MCL to that of the mixture, the highest ({where}; the interval holds for "
        "all comparisons at once)",
        ratio,
        f"The highest of others: {others}.",
    )


def widest(table: Table, name: str) -> tuple[str, Interval]:
    """Where MCL's error is the largest multiple of a filter's."""
    found = ratios(pairs(table, {"filter": "MCL"}, {"filter": name}))
    return max(found.items(), key=lambda item: item[1].low)


def rises(table: Table, name: str) -> list[Comparison]:
    """A filter's error to that with the next lower noise, for each error of the wheels."""
    steps = {}
    for moved in table.values("moved_mm"):
        found = errors(table, moved_mm=moved, filter=name)
        for k in range(1, len(found)):
            which = f"{moved} mm, {percent(NOISES[k])} to {percent(NOISES[k - 1])}"
            steps[which] = found[k], found[k - 1]
    return compared(steps)


def monotone(table: Table, name: str) -> Verdict:
    """Every rise of the noise makes the error rise; in part: none makes it fall."""
    found = rises(table, name)
    if all(c.above for c in found):
        return Verdict.REPRODUCED
    falls = any(c.below for c in found)
    return Verdict.NOT if falls or not any(c.above for c in found) else Verdict.IN_PART


def mixture_rises(table: Table) -> Finding:
    """The mixture's error is monotone in the noise."""
    found = rises(table, "mixture")
    least = min(found, key=lambda c: c.ratio.value)
    others = "; ".join(f"{name}: {monotone(table, name)}" for name in OTHERS)
    return Finding(
        monotone(table, "mixture"),
        f"the mixture's error to that with the next lower noise, the lowest ({least.told})",
        least.ratio,
        f"All: {listed(found)}. {others}.",
    )


def dual_alone(table: Table) -> Finding:
    """The error of the dual proposal alone is monotone, and above the mixture's everywhere."""
    found = against(table, "dual", "mixture")
    rest = against(table, "dual, resampled", "mixture, resampled")
    least = min(found, key=lambda c: c.ratio.value)
    shape = monotone(table, "dual")
    return Finding(
        graded([shape is Verdict.REPRODUCED, all(c.above for c in found)]),
        f"the error of the dual proposal alone to that of the mixture, the lowest ({least.told})",
        least.ratio,
        f"All: {listed(found)}. Monotone: {shape} (falls: "
        f"{listed([c for c in rises(table, 'dual') if c.below]) or 'none'}). With resampled sets: "
        f"worse in {sum(c.above for c in rest)} of {len(rest)}, better in "
        f"{sum(c.below for c in rest)}; monotone: {monotone(table, 'dual, resampled')}.",
    )


def approaches(table: Table) -> Finding:
    """Approach 2 is as good as approach 3."""
    found = against(table, FORWARD, "mixture")
    pooled = of_both(table, "mixture")
    rest = against(table, FORWARD, "mixture, resampled")
    alike = not any(c.above or c.below for c in found)
    narrow = pooled.low > 1.0 / ALIKE and pooled.high < ALIKE
    return Finding(
        Verdict.REPRODUCED if alike and narrow else Verdict.IN_PART if alike else Verdict.NOT,
        "the error with approach 2 to that with approach 3, all noises together",
        pooled,
        f"All: {listed(found)}. Against approach 3 with resampled sets: "
        f"{of_both(table, 'mixture, resampled')}, worse in {sum(c.above for c in rest)} of "
        f"{len(rest)} comparisons, better in {sum(c.below for c in rest)}.",
    )


def of_both(table: Table, name: str) -> Interval:
    """The error with approach 2 to that of another mixture: of each seed, over all noises."""
    found = pairs(table, {"filter": FORWARD}, {"filter": name}).values()
    return paired_ratio(*(np.mean([pair[k] for pair in found], axis=0) for k in (0, 1)))


def zero_weights(table: Table) -> Finding:
    """Most pairs of approach 1 have no weight."""
    shares = errors(table, "zeros", moved_mm=MOVED_MM[0], filter=PAIRS)
    found = [mean(of_noise) for of_noise in shares]
    k = int(np.argmin([i.value for i in found]))
    by_noise = dict(zip(map(percent, NOISES), found, strict=True))
    return Finding(
        graded([i.low > 0.5 for i in found]),
        f"share of approach 1's weights that are zero, the lowest ({percent(NOISES[k])} noise)",
        found[k],
        f"By noise: {told(by_noise)}.",
    )


COLORS = ("#1f5fbf", "#c0392b", "#f39c12", "#2e8b57", "#8a8a8a", "#7d3c98", "#c39bd3")


def draw(table: Table, figure: "Figure") -> None:
    """Error over noise for each filter."""
    grid = figure.subplots(1, len(MOVED_MM), sharey=True)
    for axes, moved in zip(grid, MOVED_MM, strict=True):
        for name, color in zip(FILTERS, COLORS, strict=True):
            chosen = table.where(moved_mm=moved, filter=name)
            if len(chosen):
                fmt = "s--" if name.endswith("resampled") else "o-"
                draw_curve(axes, chosen, color=color, label=name, fmt=fmt)
        finish_axes(axes, moved)
    figure.supxlabel("sensor noise [% of the image's width]")
    figure.supylabel("mean error after 100 steps [cm]")
    figure.legend(
        *grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=4, frameon=False
    )


TESTED = "paired t-tests, p < 0.05 after Holm's correction for all of them"

STUDY = Study(
    number="E9",
    title="A mixture of proposals with sensors from precise to poor",
    source="Fox01 §19.3.2, §19.3.3 and Fig. 19.10",
    about=ABOUT,
    factors={"moved_mm": MOVED_MM, "filter": tuple(FILTERS), "noise": NOISES},
    run=run,
    metrics={
        "error_m": "mean error, m",
        "failed": "no weight left",
        "zeros": "share of zero weights",
        "faster": "times faster than real time",
    },
    claims=(
        Claim(
            "The mixture is uniformly better than MCL",
            "below it at every noise (curves)",
            "in part: with a precise sensor and wheels that err by 1 mm; with 10 % noise and more "
            "MCL may even be better, since wide leaves smear what is believed. Reproduced: better "
            f"in all twelve comparisons (6 noises, 2 errors of the wheels; {TESTED}); in part: in "
            "some",
            better,
        ),
        Claim(
            "In certain cases the mixture reduces the error by more than an order of magnitude",
            "more than 10 times",
            "not with approach 3: some 8 times with 1 % noise and wheels that err by 1 mm. "
            "Reproduced: in some of the twelve comparisons the ratio is above 10 with an interval "
            "that holds for all twelve at once; in part: the ratio is, its interval is not",
            tenfold,
        ),
        Claim(
            "The error of the mixture is monotone in the noise",
            "a curve that rises throughout",
            "holds. Reproduced: with each error of the wheels, each of the five rises of the noise "
            f"makes the error rise (ten comparisons; {TESTED}); in part: some do, and none makes "
            "it fall",
            mixture_rises,
        ),
        Claim(
            "The dual proposal alone is monotone in the noise, but worse than the mixture",
            "it only considers the most recent measurement, and so is prone to fail when that errs "
            "(text)",
            "in part: worse, except with 50 % noise; not monotone at its end, where an error of "
            "0.7 m is that of knowing nothing. Reproduced: monotone as above, and worse than the "
            f"mixture in all twelve comparisons ({TESTED}); in part: one of both",
            dual_alone,
        ),
        Claim(
            "Approach 2 is a little worse than approach 3, but not significantly",
            "less favourable, not significant at 95 %",
            "not: approach 2 is better, its tree being one of equal weights. Reproduced: none of "
            f"twelve comparisons differs ({TESTED}), and the ratio over all of them lies within "
            "0.8 to 1.25 with its 95 % interval, so that they differ by little; in part: none "
            "differs, but the interval is wider",
            approaches,
        ),
        Claim(
            "With approach 1 most weights are zero",
            "suspected for many pairs; not tried there",
            "holds: 99 % are. Reproduced: the 95 % interval of their share is above one half at "
            "each noise; in part: at some",
            zero_weights,
        ),
    ),
    draw=draw,
    seeds=100,
    applies=applies,
)
