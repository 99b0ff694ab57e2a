"""Readings: most are distances to something, in metres, and the rest say plainly that they are
none.
"""

import math
from collections import Counter

import numpy as np

from mcloc.events import Scan
from mcloc.inspection.decades import Decades
from mcloc.inspection.finding import Finding

MISSING = 0.3  # share of readings without a return from which on little is left to localize by
SOME = 0.05  # share of readings from which on they are no accident
CODES = 0.5  # of the readings beyond range_max, the most in one place if they are distances
FARTHER = 3.0  # × range_max: where distances lie beyond that in the middle, a unit is wrong
USUAL = 2.5  # m: the middle of what a laser measures indoors, and …
LEAST_MIDDLE, LARGEST_MIDDLE = 0.1, 100.0  # m: where it can lie
UNITS = {"millimetres": 1e-3, "centimetres": 1e-2, "kilometres": 1e3}
PILE = 0.02  # share of the returns at one distance, …
STEEP = 10.0  # times as many as on average on the metre before it, and …
BEYOND_PILE = 1e-3  # no larger share beyond

_BIN, _FARTHEST = 0.01, 200.0  # m
_BINS = round(_FARTHEST / _BIN)


class Readings:
    """Counts of one laser's readings, by what they are.

    total: all. kinds: how many are no return, by what they are instead. range_min, range_max:
    metres, as last stated.
    """

    def __init__(self) -> None:
        self.total = 0
        self.kinds: Counter[str] = Counter()
        self.range_min, self.range_max = 0.0, math.inf
        self._returns, self._beyond = Decades(), Decades()
        self._fine = np.zeros(_BINS, dtype=np.int64)

    def add(self, scan: Scan) -> None:
        """The readings of the next scan."""
        r, ok = scan.ranges, scan.returned
        with np.errstate(invalid="ignore"):
            beyond = np.isfinite(r) & (r >= scan.range_max)
            kinds = {
                "NaN": np.isnan(r),
                "infinite": np.isinf(r),
                "at or beyond range_max": beyond,
                "0 or less": np.isfinite(r) & (r <= 0.0),
                "below range_min": np.isfinite(r) & (r > 0.0) & (r < scan.range_min) & ~beyond,
            }
        self.kinds.update({kind: int(found.sum()) for kind, found in kinds.items() if found.any()})
        self.total += len(r)
        self.range_min, self.range_max = scan.range_min, scan.range_max
        self._returns.add(r[ok])
        self._beyond.add(r[beyond])
        fine = np.minimum(r[ok], _FARTHEST) / _BIN
        np.add.at(self._fine, np.minimum(fine, _BINS - 1).astype(np.intp), 1)

    @property
    def returns(self) -> int:
        """How many readings are distances to something."""
        return self._returns.total

    @property
    def missing(self) -> float:
        """Share of the readings that are no return; NaN without readings."""
        return 1.0 - self.returns / self.total if self.total else math.nan

    @property
    def median(self) -> float:
        """Metres: the middle of the returns, to 2.3 %; NaN without any."""
        return self._returns.median

    @property
    def farther(self) -> tuple[int, float]:
        """How many readings from range_max on are distances, not codes, and their median, metres.

        Codes are one value, or a few close together; distances are spread.
        """
        total = self._beyond.total
        if self._beyond.alike > CODES * total:
            return 0, math.nan
        return total, self._beyond.median

    @property
    def pile(self) -> tuple[float, float]:
        """The distance at which the returns end in a heap, metres, and the share of them that it
        holds; NaN and 0 where they peter out.
        """
        total = self.returns
        if total == 0:
            return math.nan, 0.0
        above = np.cumsum(self._fine[::-1])[::-1]
        top = int(np.flatnonzero(above > BEYOND_PILE * total).max())
        heap = int(self._fine[max(top - 1, 0) : top + 2].sum())
        before = self._fine[max(top - 101, 0) : max(top - 1, 0)]
        if heap <= PILE * total or (before.size and heap <= STEEP * 3 * before.mean()):
            return math.nan, 0.0
        return top * _BIN, heap / total


def inspect_readings(name: str, readings: Readings) -> list[Finding]:
    """What looks wrong with one laser's readings."""
    unit = _unit(name, readings)
    if unit is not None:
        return [unit]
    limits = _range_max_low(name, readings) or _range_min_high(name, readings)
    found = (limits or _missing(name, readings), _cut(name, readings))
    return [finding for finding in found if finding is not None]


def _unit(name: str, readings: Readings) -> Finding | None:
    """What a laser sees is neither as near as 0.1 m nor as far as 100 m, in the middle."""
    farther, middle = readings.farther
    if farther <= SOME * readings.total or middle <= FARTHER * readings.range_max:
        middle = readings.median
        if math.isnan(middle) or LEAST_MIDDLE <= middle <= LARGEST_MIDDLE:
            return None
    unit = min(UNITS, key=lambda unit: abs(math.log(middle * UNITS[unit] / USUAL)))
    return Finding(
        "ranges-unit",
        name,
        f"the ranges are no metres; they may be {unit}",
        f"half of the distances are beyond {middle:.3g} m, range_max is {readings.range_max:g} m",
        f"multiply the ranges by {UNITS[unit]:g}",
    )


def _range_max_low(name: str, readings: Readings) -> Finding | None:
    """Distances are measured beyond the limit that is stated, and thrown away."""
    farther, middle = readings.farther
    if farther <= SOME * readings.total:
        return None
    return Finding(
        "range-max-low",
        name,
        f"range_max = {readings.range_max:g} m is less than what the laser measures",
        f"{100 * farther / readings.total:.0f} % of the readings lie beyond, spread around"
        f" {middle:.3g} m as only distances are",
        "state the laser's own limit as range_max",
    )


def _range_min_high(name: str, readings: Readings) -> Finding | None:
    """The lower limit that is stated throws away much of what is measured."""
    share = readings.kinds["below range_min"] / max(readings.total, 1)
    if share <= MISSING:
        return None
    return Finding(
        "range-min-high",
        name,
        f"range_min = {readings.range_min:g} m is more than much of what the laser measures",
        f"{100 * share:.0f} % of the readings lie below",
        "state the laser's own limit as range_min, in metres",
    )


def _missing(name: str, readings: Readings) -> Finding | None:
    """More than MISSING of the readings are no return."""
    if not readings.missing > MISSING:
        return None
    kinds = (f"{100 * n / readings.total:.0f} % {k}" for k, n in readings.kinds.most_common())
    return Finding(
        "returns-missing",
        name,
        f"{100 * readings.missing:.0f} % of the readings are no return",
        f"{', '.join(kinds)}; range_min is {readings.range_min:g} m, range_max"
        f" {readings.range_max:g} m",
        "check the laser's limits, its window, and whether it looks into the open",
    )


def _cut(name: str, readings: Readings) -> Finding | None:
    """Distances peter out; where they end in a heap, that is the laser's true limit."""
    at, share = readings.pile
    if share == 0.0:
        return None
    return Finding(
        "ranges-cut",
        name,
        f"readings of {at:.2f} m look like no return, but range_max is {readings.range_max:g} m",
        f"{100 * share:.0f} % of the returns are within 2 cm of it, and hardly any beyond",
        f"state range_max = {at - _BIN:.2f} m, or they will be taken for walls",
    )
