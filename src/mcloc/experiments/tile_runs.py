"""What a drive over tiles measures, and comparisons that E19, E20 and E21 share."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.evaluation.intervals import Interval, mean, median
from mcloc.experiments.comparisons import Comparison, compared, graded, listed
from mcloc.experiments.study import Finding, Verdict
from mcloc.experiments.table import Setting, Table
from mcloc.experiments.tile_world import IN_A_ROW, NEAR

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ERRORS = (1, 5)
EVERY = 8  # iterations between the points of a curve
COLOURS = ("#7a7a7a", "#d6336c", "#e8590c", "#1f5fbf", "#0b7285", "#66a80f", "#9c36b5", "#343a40")

METRICS = {
    "reached": "iterations until the error is below 5 tiles for the first time",
    "settled": "iterations until it stays there for 20",
    "early": "mean error in the first 100 iterations, tiles",
    "tracking": "mean error in the last 100 iterations, tiles",
    "peaks": "share of these with an error of 5 tiles or more",
}

Curve = NDArray[np.float64]


def measured(errors: ArrayLike) -> dict[str, Any]:
    """Of the errors after each iteration, (N,) tiles."""
    e = np.asarray(errors, dtype=np.float64)
    near = e < NEAR
    row = np.convolve(near, np.ones(IN_A_ROW, dtype=int), "valid") == IN_A_ROW
    return {
        "reached": _first(near, len(e)),
        "settled": _first(row, len(e)),
        "early": float(e[:100].mean()),
        "tracking": float(e[-100:].mean()),
        "peaks": float(1.0 - near[-100:].mean()),
        "curve": e[::EVERY].tolist(),
    }


def _first(holds: NDArray[np.bool_], n: int) -> int:
    """Which iteration is the first to hold, from 1; n + 1 for none."""
    return int(np.argmax(holds)) + 1 if holds.any() else n + 1


ARRIVAL = ("reached", "settled")
"""By which a filter is there: a lucky iteration reaches the place, and does not show on a curve."""


def arrivals(table: Table, method: str) -> dict[str, Interval]:
    """Of a method, by the sensor's error and what counts as being there."""
    return {
        f"{metric}, off by {error}": median(table.where(off_by=error, method=method).column(metric))
        for metric in ARRIVAL
        for error in table.values("off_by")
    }


def means(table: Table, metric: str, method: str) -> dict[str, Interval]:
    """Of a method, by the sensor's error."""
    return {
        f"off by {error}": mean(table.where(off_by=error, method=method).column(metric))
        for error in table.values("off_by")
    }


def everywhere(found: Sequence[Comparison], what: str) -> Finding:
    """A claim that the first of two is larger in all comparisons; `what` names their ratio."""
    above = [c.above for c in found]
    hardest = min(found, key=lambda c: c.ratio.value)
    return Finding(
        graded(above),
        f"{what} ({hardest.told})",
        hardest.ratio,
        f"All: {listed(found)}. It holds in {sum(above)} of {len(found)} "
        f"comparisons, the opposite in {sum(c.below for c in found)}.",
    )


def about(found: Mapping[str, Interval], number: float) -> Verdict:
    """Whether medians are that number, within a factor of 2 either way."""
    low, high = 0.5 * number, 2.0 * number
    if all(low <= i.low and i.high <= high for i in found.values()):
        return Verdict.REPRODUCED
    met = any(i.low <= high and low <= i.high for i in found.values())
    return Verdict.IN_PART if met else Verdict.NOT


def against(
    table: Table, metrics: Sequence[str], pairs: Sequence[tuple[str, str]]
) -> list[Comparison]:
    """The other's metric to that of a method, for each pair (method, other), each of the sensor's
    errors and each metric; corrected for all of them.
    """
    chosen = {}
    for metric in metrics:
        for error in table.values("off_by"):
            for one, other in pairs:
                which = f"{other} to {one}, off by {error}"
                told = which if len(metrics) == 1 else f"{which}, {metric}"
                chosen[told] = table.paired(metric, _of(error, other), _of(error, one))
    return compared(chosen)


def _of(error: Any, method: str) -> Setting:
    return {"off_by": error, "method": method}


def draw_curves(axes: "Axes", table: Table, methods: Sequence[str]) -> None:
    """The mean error over the iterations."""
    for method, colour in zip(methods, COLOURS, strict=False):
        curves = [record["curve"] for record in table.where(method=method).records()]
        mean = np.mean(curves, axis=0)
        axes.plot(1 + EVERY * np.arange(len(mean)), mean, color=colour, lw=1.2, label=method)
    axes.axhline(NEAR, color="0.6", lw=0.8, ls=":")
    axes.set(xlabel="iteration", ylabel="mean error, tiles", yscale="log", ylim=(0.3, 80))
    axes.grid(alpha=0.3)
