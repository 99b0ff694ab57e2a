"""E11: a robot that is kidnapped in a museum, by the share of time that it is lost  [Fox01 §19.3.4,
Fig. 19.13].
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np

from mcloc.evaluation.intervals import LEVEL, Interval, holm, mean, paired_p, paired_ratio
from mcloc.experiments.driving import errors_of, localized
from mcloc.experiments.places import Drive, drive, files, missing
from mcloc.experiments.study import Claim, Finding, Study, Verdict
from mcloc.experiments.table import Record, Setting, Table
from mcloc.filters.catalog import Composition
from mcloc.simulation.teleports import teleported

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MUSEUM = "generated museum"
SAMPLES = (200, 1000, 5000)
LENGTH = 200.0  # m of each drive
PER_METRE = 0.01  # kidnappings
LOST = 2.0  # m
PHI = 0.1  # share of the belief that the paper draws from the scan
RANDOM = 0.05
HARDLY = 0.001  # α of the paper's mixture

MCL, WITH_RANDOM = "MCL", "MCL with 5 % random"
PAPERS, BARE = "paper's mixture", "paper's mixture without α"
OURS, RESETTING = "mcloc's mixture", "sensor resetting"
METHODS = (MCL, WITH_RANDOM, PAPERS, BARE, OURS, RESETTING)
BARE_WITH = 1000  # samples
SAMPLER = "feature-tree"  # mcloc's default when the study was made

ABOUT = """
A robot with a laser drives 200 m through a museum, from a place that it knows; with probability
0.01 for each metre it is carried off without being told. The figure is the share of time with an
error above 2 m, over the number of samples. The axis of the paper's figure is not readable, so that
the numbers of samples are ours.

- The robot is really carried off: at the moment that is drawn it goes on from another moment of the
  log, at least 5 m away and anywhere along its path, while its odometry tells of no move. The paper
  put errors into the odometry.
- *generated museum*: another one for each seed. *fhw*: a recorded museum, with a scan each metre.
- *MCL* has no random samples; *MCL with 5 % random* has 5 % of them in each step, anywhere on the
  free floor. None of the paper's filters has mcloc's doubt in the wheels.
- *paper's mixture*: φ = 0.1 of the belief is drawn from the scan in each step and weighed by a tree
  of forward samples (approach 2), in a group that is normalized apart. mcloc's density trees are 0
  away from all samples. Where poses from the scan have no density at all, their group has no
  weight, and the robot is found by chance alone: *without α* is this filter, with 1,000 samples.
  The paper recovers, so its tree must have been above 0 everywhere; the cells of a plain kd-tree,
  which it cites, cover all poses, and those at the rim have wide ones. Here that is α = 0.001 of
  random poses in the dynamics, one sample of 1,000: fifty times fewer than 5 %, so that it is not
  these which find the robot. A first look at one run showed the same with 0.001, 0.01 and 0.05.
- *mcloc's mixture* is its default filter, with doubt in the wheels and all: it draws from the scan
  only while its recovery says that it may be lost. *sensor resetting* [Lenser, Veloso 2000] asks
  the same recovery, and puts its poses in the place of samples.
- All methods have the same number of samples in total, fixed. Poses from the scan come from
  the feature tree, which takes the paper's mixture some 10 ms at each step; the times in the
  table are for comparison with each other only, since other work shared the two cores. Sensor and
  motion models are mcloc's defaults, and so is the policy: an update each 0.2 m or 0.2 rad, in
  which a scan counts in proportion to the way since the last one.
- Significant: in a t-test of pairs, seed by seed, with all comparisons of a claim (each number of
  samples at each place) corrected together [Holm 1979]. That a method loses 70 % less is tested
  against 0.3 of the time that the other one loses.
- Predictions and rules were written after one run of each method with 1,000 samples had been seen
  at both places, and before all others. Then one run of each setting told how long the study takes:
  a fourth number of samples was left out, and there are 12 seeds instead of 16.
"""


@lru_cache(maxsize=2)  # runs come seed by seed, at both places
def kidnapped(place: str, seed: int) -> tuple[Drive, int]:
    """A drive with kidnappings, and how many."""
    driven = drive(place, seed, LENGTH)
    carried = teleported(driven.events, driven.truth, seed, per_metre=PER_METRE, length=LENGTH)
    return Drive(driven.grid, carried.events, carried.truth), len(carried.kidnappings)


def run(setting: Setting, seed: int) -> Record:
    """Localize one robot by one method."""
    driven, times = kidnapped(str(setting["place"]), seed)
    history = localized(
        driven,
        composition(str(setting["method"]), int(setting["samples"])),
        seed,
        initial=driven.truth.poses[0],
    )
    return {
        "lost": errors_of(driven, history).lost_fraction(LOST),
        "kidnapped": times,
        # The median: the first update of a process compiles.
        "update_ms": 1e3 * float(np.median(history.updates.table[:, 1])),
    }


def composition(method: str, samples: int) -> Composition:
    """One of METHODS with as many samples in total."""
    size, trusted = {"particles": samples}, {"doubt_below": 0.0}
    if method == OURS:
        return Composition(
            "mixture",
            sampler=SAMPLER,
            size="fixed",
            settings={"size": size, "filter": {"particles": samples}},
        )
    if method == RESETTING:
        return Composition(
            "sensor-resetting", sampler=SAMPLER, size="fixed", settings={"size": size}
        )
    share = {MCL: 0.0, BARE: 0.0, WITH_RANDOM: RANDOM, PAPERS: HARDLY}[method]
    recovery = {**trusted, "share": share}
    if method in (PAPERS, BARE):
        return Composition(
            "mixture-grouped",
            sampler=SAMPLER,
            recovery="random",
            settings={"filter": {"phi": PHI, "particles": samples}, "recovery": recovery},
        )
    return Composition(
        "mcl", size="fixed", recovery="random", settings={"size": size, "recovery": recovery}
    )


@dataclass(frozen=True)
class Comparison:
    """How much less time one method loses than another.

    where: place and samples, in words. less: percent. p: that it loses less; by_p: that it loses
    less by as much as is claimed. Both by chance, corrected for all comparisons of the claim.
    """

    place: str
    where: str
    less: Interval
    p: float
    by_p: float

    @property
    def is_less(self) -> bool:
        return self.p < 1.0 - LEVEL

    @property
    def is_by(self) -> bool:
        return self.by_p < 1.0 - LEVEL


def comparisons(table: Table, method: str, than: str, by: float) -> list[Comparison]:
    """One for each number of samples at each place. by: the share of `than`'s time, 0 … 1."""
    found = list(_pairs(table, method, than))
    p = holm([_p_below(ours, theirs) for _, _, ours, theirs in found])
    by_p = holm([_p_below(ours, (1.0 - by) * theirs) for _, _, ours, theirs in found])
    return [
        Comparison(place, f"{place}, {samples:,}", _less(ours, theirs), float(one), float(other))
        for (place, samples, ours, theirs), one, other in zip(found, p, by_p, strict=True)
    ]


_Pairs = tuple[str, int, np.ndarray, np.ndarray]


def _pairs(table: Table, method: str, than: str) -> Iterator[_Pairs]:
    for place in table.values("place"):
        for samples in SAMPLES:
            common: Setting = {"place": place, "samples": samples}
            pairs = table.paired("lost", {**common, "method": method}, {**common, "method": than})
            yield str(place), samples, *pairs


def _p_below(a: np.ndarray, b: np.ndarray) -> float:
    """Of a mean of a below that of b, and 1 where it is not."""
    return paired_p(a, b) if a.mean() < b.mean() else 1.0


def _less(ours: np.ndarray, theirs: np.ndarray) -> Interval:
    """By how many percent; nothing is known where the other never loses the robot."""
    if theirs.max() == 0.0:
        return Interval(np.nan, np.nan, np.nan)
    ratio = paired_ratio(ours, theirs)
    return Interval(*(100.0 * (1.0 - x) for x in (ratio.value, ratio.high, ratio.low)))


def as_much_as(table: Table, than: str, by: float) -> Finding:
    """The paper's mixture loses less than another method, and by as much as is claimed with some
    number of samples.
    """
    found = comparisons(table, PAPERS, than, by)
    places = {c.place for c in found}
    if all(c.is_less for c in found) and {c.place for c in found if c.is_by} == places:
        verdict = Verdict.REPRODUCED
    else:
        verdict = Verdict.IN_PART if any(c.is_less for c in found) else Verdict.NOT
    return _finding(verdict, found, than, by, max(found, key=_value), "most")


def ambition(table: Table, by: float) -> Finding:
    """mcloc's mixture loses less than MCL by as much as we want, whatever the number of samples."""
    found = comparisons(table, OURS, MCL, by)
    if all(c.is_by for c in found):
        verdict = Verdict.REPRODUCED
    else:
        verdict = Verdict.IN_PART if any(c.is_by for c in found) else Verdict.NOT
    return _finding(verdict, found, MCL, by, min(found, key=_value), "least")


def _value(comparison: Comparison) -> float:
    return float(np.nan_to_num(comparison.less.value))


def _finding(
    verdict: Verdict, found: list[Comparison], than: str, by: float, told: Comparison, which: str
) -> Finding:
    other = (min if which == "most" else max)(found, key=_value)
    return Finding(
        verdict,
        f"percent of time lost less than by {than}, the {which} ({told.where} samples)",
        told.less,
        f"Significantly less in {sum(c.is_less for c in found)} of {len(found)} comparisons, by "
        f"{100 * by:g} % or more in {sum(c.is_by for c in found)}. The "
        f"{'least' if which == 'most' else 'most'}: {other.less} ({other.where} samples).",
    )


def applies(setting: Setting) -> bool:
    """The mixture without α is shown with one number of samples."""
    return setting["method"] != BARE or setting["samples"] == BARE_WITH


STYLES = {
    MCL: ("#c0392b", "o"),
    WITH_RANDOM: ("#d68910", "s"),
    PAPERS: ("#1f5fbf", "D"),
    BARE: ("#7f8c8d", "X"),
    OURS: ("#1e8449", "^"),
    RESETTING: ("#8e44ad", "v"),
}
SPREAD = 0.03  # of the logarithm of the samples, so that marks lie beside each other


def draw(table: Table, figure: "Figure") -> None:
    """Time lost over the number of samples, as in the paper, on a logarithmic axis: the methods
    differ by more than tenfold.
    """
    places = table.values("place")
    row = figure.subplots(1, len(places), squeeze=False, sharey=True)[0]
    for axes, place in zip(row, places, strict=True):
        for k, (method, (color, marker)) in enumerate(STYLES.items()):
            samples = SAMPLES if method != BARE else (BARE_WITH,)
            intervals = [
                mean(table.where(place=place, method=method, samples=n).column("lost"))
                for n in samples
            ]
            value, low, high = 100.0 * np.array([(i.value, i.low, i.high) for i in intervals]).T
            axes.errorbar(
                np.array(samples) * np.exp(SPREAD * (k - len(STYLES) / 2)),
                value,
                yerr=(value - low, high - value),
                color=color,
                marker=marker,
                label=method,
                lw=1.5,
                capsize=2,
            )
        axes.set(xscale="log", title=str(place))
        axes.set_yscale("symlog", linthresh=1.0, linscale=0.3)
        axes.set_ylim(0.0, 100.0)
        axes.set_xticks(SAMPLES, [f"{n:,}" for n in SAMPLES])
        axes.set_yticks(
            (0, 1, 2, 5, 10, 20, 50, 100), ("0", "1", "2", "5", "10", "20", "50", "100")
        )
        axes.minorticks_off()
        axes.grid(alpha=0.3)
    figure.supxlabel("samples")
    figure.supylabel(f"share of time more than {LOST:g} m off [%]")
    figure.legend(
        *row[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False
    )


STUDY = Study(
    number="E11",
    title="Kidnapped in a museum: how long the robot is lost",
    source="Fox01 §19.3.4, Fig. 19.13",
    about=ABOUT,
    factors={"place": (MUSEUM, "fhw"), "samples": SAMPLES, "method": METHODS},
    run=run,
    metrics={
        "lost": "share of time > 2 m off",
        "kidnapped": "kidnappings",
        "update_ms": "median ms an update",
    },
    claims=(
        Claim(
            "The paper's mixture loses as much as 70 % less time than MCL",
            "as much as 70 % less, significant at 95 %",
            "holds at both places, with far more than 70 %: mcloc's poses from the scan hold the "
            "true place nearly always. The fewer the samples the less, since with 200 of them 20 "
            "come from the scan. Reproduced: at both places it loses significantly less with every "
            "number of samples, and significantly 70 % less or more with some; in part: "
            "significantly less in some comparison",
            partial(as_much_as, than=MCL, by=0.70),
        ),
        Claim(
            "It loses 32 % less time than MCL with 5 % random samples",
            "32 % less, significant at 95 %",
            "holds: random samples must meet the true place to 0.3 m and 10° or so, which some "
            "hundred of them seldom do. With 5,000 samples in the generated museum the difference "
            "is the smallest. Reproduced: at both places it loses significantly less with every "
            "number of samples, and significantly 32 % less or more with some; in part: "
            "significantly less in some comparison",
            partial(as_much_as, than=WITH_RANDOM, by=0.32),
        ),
        Claim(
            "Our own ambition, of which the paper says nothing: mcloc's mixture loses at least "
            "90 % less time than MCL",
            "none",
            "holds with 1,000 samples and more; with 200, of which half are to hold all places "
            "that a scan may be from, robots stay lost for longer, and it is open whether 90 % "
            "are reached. Reproduced: significantly 90 % less or more with every number of samples "
            "at both places; in part: in some comparison",
            partial(ambition, by=0.90),
        ),
    ),
    draw=draw,
    seeds=12,
    applies=applies,
    missing=missing,
    inputs=files,
)
