"""Sightings of landmarks: of which ones, how many, and how far away they are."""

from collections import Counter

import numpy as np

from mcloc.events import Sightings
from mcloc.inspection.decades import Decades
from mcloc.inspection.finding import Finding
from mcloc.inspection.stamps import Stamps, inspect_order, inspect_overlap

NAME = "sightings"


class SightingsInspection:
    """Counts of a robot's sightings.

    stamps: of the events. of: how many sightings there are of each landmark, by its index.
    """

    def __init__(self) -> None:
        self.stamps = Stamps()
        self.of: Counter[int] = Counter()
        self._ranges = Decades()

    def add(self, z: Sightings) -> None:
        """The next event."""
        self.stamps.add(z.t)
        self.of.update(z.landmark.tolist())
        self._ranges.add(z.range[np.isfinite(z.range) & (z.range > 0.0)])

    @property
    def median(self) -> float:
        """Metres: the middle of the ranges, to 2.3 %; NaN without any."""
        return self._ranges.median


def inspect_sightings(odometry: Stamps, sightings: SightingsInspection) -> list[Finding]:
    """What looks wrong with their clock. That there are none for long is usual."""
    apart = inspect_overlap(odometry, NAME, sightings.stamps)
    return inspect_order(NAME, sightings.stamps) + ([] if apart is None else [apart])
