"""Do the scans of a laser and the odometry tell of the same motion? Each single fault is tried: the
points of a scan, moved as the wheels would then say, must come to lie on those of the next.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.events import Scan
from mcloc.inspection.faults import (
    DEGREES,
    LENGTHS,
    MIRRORED,
    NO_WAY,
    NONE,
    SIGN,
    STILL,
    TURNED,
    Fault,
)
from mcloc.inspection.scan_pairs import Pair, Pairs

APART = 0.2  # m between what two faults predict, on average, for a pair to tell them apart
LEAST_PAIRS = 10
BETTER = 0.85  # of the residual as stated, the most that a fault may leave to be believed
SURE = 4.0  # standard errors of the mean difference; no right log at hand came above −3
REJECTED = 3.0  # the same, the other way round: the fault is not there


@dataclass(frozen=True, slots=True)
class Comparison:
    """A fault against the log as it is, on the pairs that tell the two apart.

    pairs: how many. stated, faulty: mean residuals, metres. errors: by how many standard errors the
    fault is the better one.
    """

    fault: Fault
    pairs: int
    stated: float
    faulty: float
    errors: float

    @property
    def believed(self) -> bool:
        return (
            self.pairs >= LEAST_PAIRS
            and self.faulty <= BETTER * self.stated
            and self.errors >= SURE
        )

    @property
    def rejected(self) -> bool:
        return self.pairs >= LEAST_PAIRS and self.errors <= -REJECTED


class Consistency:
    """Scans of one laser, each with its odometry, and what they say of each fault."""

    def __init__(self) -> None:
        self._pairs = {fault: Pairs(fault) for fault in (NONE, *LENGTHS, DEGREES)}

    def add(self, scan: Scan) -> None:
        """The next scan, with its odometry."""
        for pairs in self._pairs.values():
            pairs.add(scan)

    def compare(self) -> list[Comparison]:
        """All faults against what the log states."""
        alike = (*TURNED, *MIRRORED, SIGN, STILL, NO_WAY)
        return [
            *compare(self._pairs[NONE].kept, alike),
            *(c for unit in (*LENGTHS, DEGREES) for c in compare(self._pairs[unit].kept, (unit,))),
        ]


def compare(pairs: Iterable[Pair], faults: Sequence[Fault]) -> list[Comparison]:
    """Each fault against what is stated."""
    measured = [pair.residuals((NONE, *faults)) for pair in pairs]
    if not measured:
        return [Comparison(fault, 0, math.nan, math.nan, 0.0) for fault in faults]
    residuals, apart = (np.array(values) for values in zip(*measured, strict=True))
    return [
        _comparison(fault, residuals[telling, 0], residuals[telling, k])
        for k, fault in enumerate(faults, start=1)
        for telling in [apart[:, k] >= APART]
    ]


def _comparison(
    fault: Fault, stated: NDArray[np.float64], faulty: NDArray[np.float64]
) -> Comparison:
    n = len(stated)
    if n < 2:
        return Comparison(fault, n, math.nan, math.nan, 0.0)
    gain = stated - faulty
    spread = max(float(gain.std(ddof=1)), 1e-9)  # alike for all pairs: as sure as can be
    errors = float(gain.mean()) / spread * math.sqrt(n)
    return Comparison(fault, n, float(stated.mean()), float(faulty.mean()), errors)


def verdict(comparisons: Sequence[Comparison]) -> Comparison | None:
    """The fault that explains the log much better than no fault does, if there is one.

    Lengths are not in doubt where they are better than none: pairs of scans that are far apart in
    truth would fit almost anything better than wheels that drift. That the robot stands still is
    said only of a log that no fault explains.
    """
    by_fault = {c.fault: c for c in comparisons}
    believed = [c for fault, c in by_fault.items() if c.believed and fault not in (STILL, NO_WAY)]
    if by_fault[NO_WAY].rejected:
        believed = [c for c in believed if c.fault not in LENGTHS]
    if believed:
        return max(believed, key=lambda c: c.stated - c.faulty)
    return by_fault[STILL] if by_fault[STILL].believed else None
