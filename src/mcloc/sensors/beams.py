"""p(z | x) = Π_k p(z_k | x)^β, β = effective_beams · novelty / (beams used): which beams of a scan
count, and for how much.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.events import Scan
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.registry import Configurable, param


@dataclass(frozen=True)
class ScanModel(Configurable):
    """What all sensor models of laser scans share.

    Of each scan at most max_beams beams are used, evenly spread. They are not independent:
    neighbours hit the same surface, and the same error of the map is met by scan after scan. The
    log-likelihood is therefore tempered by β, everywhere the same. Beams that say nothing count
    among the beams used.
    """

    grid: OccupancyGrid
    max_beams: int = param(60, "", "most beams used of a scan", low=1)
    effective_beams: float = param(
        12.0, "", "independent beams that the used ones are worth", above=0, high=1e4
    )

    def used_beams(self, z: Scan) -> NDArray[np.intp]:
        """Which beams of a scan are used."""
        n = len(z.ranges)
        if n <= self.max_beams:
            return np.arange(n)
        # More than 1 apart, so no two are rounded to the same.
        steps = np.arange(self.max_beams) * ((n - 1) / max(self.max_beams - 1, 1))
        used: NDArray[np.intp] = np.rint(steps).astype(np.intp)
        return used

    def beams(self, z: Scan) -> int:
        """How many beams of a scan are used."""
        return min(len(z.ranges), self.max_beams)

    def tempering(self, z: Scan) -> float:
        """β: how much of an independent reading each used beam is worth."""
        return self.readings(z) / max(self.beams(z), 1)

    def readings(self, z: Scan) -> float:
        """effective_beams × novelty: the beams that a scan is worth, however many of them are
        used.
        """
        return self.effective_beams * z.novelty

    def source(self, z: Scan) -> str:
        """The laser's name."""
        return z.source
