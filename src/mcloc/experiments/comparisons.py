"""Several comparisons of mean errors that decide one claim together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.evaluation.intervals import LEVEL, Interval, holm, paired_p, paired_ratio
from mcloc.experiments.study import Verdict

ALPHA = 1.0 - LEVEL

Errors = NDArray[np.float64]
Pairs = Mapping[str, tuple[Errors, Errors]]
"""{which: (errors, errors)}: (seeds,) each, seed by seed."""


@dataclass(frozen=True)
class Comparison:
    """Two mean errors. told: which. ratio: of the first to the second. p: how probable such a
    difference would be by chance, two-sided, corrected for all comparisons that decide with it.
    """

    told: str
    ratio: Interval
    p: float

    @property
    def above(self) -> bool:
        """Whether the first is certainly larger."""
        return self.p < ALPHA and self.ratio.value > 1.0

    @property
    def below(self) -> bool:
        """Whether the first is certainly smaller."""
        return self.p < ALPHA and self.ratio.value < 1.0

    def __str__(self) -> str:
        return f"{self.told}: {self.ratio}, p = {self.p:.2g}"


def compared(pairs: Pairs) -> list[Comparison]:
    """As many comparisons: the ratios with their own intervals, the p-values corrected by Holm."""
    corrected = holm([paired_p(a, b) for a, b in pairs.values()])
    return [
        Comparison(which, _ratio(a, b), float(p))
        for (which, (a, b)), p in zip(pairs.items(), corrected, strict=True)
    ]


def _ratio(a: Errors, b: Errors) -> Interval:
    """Without limits where the second never errs: then the ratio is ∞, or none."""
    if b.max() > 0.0:
        return paired_ratio(a, b)
    return Interval(np.inf if a.max() > 0.0 else np.nan, np.nan, np.nan)


def ratios(pairs: Pairs) -> dict[str, Interval]:
    """{which: ratio}, with intervals so wide that 95 % of studies have all of them right
    (Bonferroni).
    """
    level = 1.0 - ALPHA / len(pairs)
    return {which: paired_ratio(a, b, level) for which, (a, b) in pairs.items()}


def graded(holds: Sequence[bool]) -> Verdict:
    """Of a claim that is asked in several places."""
    return Verdict.REPRODUCED if all(holds) else Verdict.IN_PART if any(holds) else Verdict.NOT


def listed(found: Sequence[Comparison]) -> str:
    """All of them in a row."""
    return "; ".join(map(str, found))


def told(found: Mapping[str, Interval]) -> str:
    """All of them in a row."""
    return "; ".join(f"{which}: {interval}" for which, interval in found.items())
