"""Decades: positive numbers of any size, counted in bins that grow with them: a median in bounded
memory.
"""

import math

import numpy as np
from numpy.typing import NDArray

PER_DECADE = 50  # bins: a median is right to 2.3 %
LEAST, DECADES = 1e-6, 18  # what lies outside counts with the outermost bins


class Decades:
    """Counts of numbers > 0."""

    def __init__(self) -> None:
        self._counts = np.zeros(DECADES * PER_DECADE, dtype=np.int64)

    def add(self, values: NDArray[np.float64] | float) -> None:
        """More numbers, finite and > 0."""
        bins = PER_DECADE * np.log10(np.asarray(values) / LEAST)
        at = np.clip(bins, 0, len(self._counts) - 1).astype(np.intp)
        np.add.at(self._counts, at, 1)

    @property
    def total(self) -> int:
        """How many."""
        return int(self._counts.sum())

    @property
    def median(self) -> float:
        """NaN of nothing."""
        if self.total == 0:
            return math.nan
        bin = int(np.searchsorted(np.cumsum(self._counts), 0.5 * self.total))
        return float(LEAST * 10.0 ** ((bin + 0.5) / PER_DECADE))

    @property
    def alike(self) -> int:
        """The most of them that lie within 5 to 10 % of each other."""
        return int((self._counts[1:] + self._counts[:-1]).max())
