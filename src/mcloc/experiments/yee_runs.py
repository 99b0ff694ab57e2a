"""The filters of E15 to E17, and what is measured of a run  [Yee §5]."""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from mcloc.experiments.driving import EVERY_SCAN, localized
from mcloc.experiments.places import Drive
from mcloc.experiments.table import Record, Setting
from mcloc.experiments.yee_world import SENSOR
from mcloc.filters.catalog import Composition

SIZES = (100, 300, 1000, 3000, 10_000, 30_000, 100_000)
FEW = SIZES[0]
SWEPT = (100, 1000)  # samples with which other parameters are tried
LOST = 0.5  # m
STEADY = 10  # scans, 1.5 m of driving, after which a robot counts as found again
MCL, RANDOM, RENEWING = "MCL", "MCL with 5 % random", "MCL with re-initialisation"
SPACING = 0.25  # m, by the rule of E17
THRESHOLD, MOST, RATE, COLLAPSED, ALPHA = 0.2, 0.5, 0.3, 2.0 * LOST, 0.01
OTHER_THRESHOLDS = {
    f"{RENEWING}, threshold {value}": value for value in (0.5 * THRESHOLD, 2.0 * THRESHOLD)
}
SHARES = {MCL: 0.0, RANDOM: 0.05, **{f"MCL with {s} % random": s / 100.0 for s in (1, 20, 50)}}

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
