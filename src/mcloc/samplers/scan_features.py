"""Features of a scan: the mean of log(1 + r) over the beams in each sector of the field of view."""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mcloc.events import Scan

TURN = 2.0 * np.pi


def heard(z: Scan) -> NDArray[np.bool_]:
    """(B,): which readings say something: returns, and "nothing within reach", inf or anything from
    range_max on. NaN, −inf and what is ≤ 0 or below range_min are errors of the sensor.
    """
    told: NDArray[np.bool_] = z.returned | (z.ranges >= z.range_max)
    return told


@dataclass(frozen=True)
class Sectors:
    """Equal sectors of a laser's field of view.

    rays: of a ring of rays all around, ray k of which goes k · 2π / rays to the left of straight
    ahead. first: (S + 1,) the first ray of each sector, and the one after the last. reach: metres,
    nothing is taken to be farther. begin, width: of the sectors, radians, sensor frame. Lasers of
    the same rays and the same reach have the same features.
    """

    rays: int
    first: tuple[int, ...]
    reach: float
    begin: float = field(compare=False)
    width: float = field(compare=False)

    @classmethod
    def of(cls, angles: NDArray[np.float64], most: int, rays: int, reach: float) -> "Sectors":
        """Those of a laser with beams at the angles (B,), B ≥ 1: `most`, or fewer where its field
        is so narrow that some would be without a ray.

        Each beam stands for all directions that are nearer to it than to its neighbours. What the
        laser does not see is the largest gap between two beams, unless it is as small as others.
        """
        turned = np.sort(np.mod(angles, TURN))
        gaps = np.diff(turned, append=turned[0] + TURN)
        largest = int(gaps.argmax())
        between = TURN - float(gaps[largest])
        beam = between / (len(turned) - 1) if len(turned) > 1 else TURN / rays
        begin, seen = float(turned[(largest + 1) % len(turned)]) - 0.5 * beam, between + beam
        if seen > TURN - 0.5 * beam:
            begin, seen = -np.pi - 0.5 * beam, TURN
        count = max(min(most, int(seen * rays / TURN + 1e-6)), 1)
        edges = begin + seen / count * np.arange(count + 1)
        first = np.ceil(edges * rays / TURN - 1e-6).astype(int)  # beams lie on rays, but for 1e-6
        first[-1] = max(first[-1], first[-2] + 1)
        first -= first[0] // rays * rays
        return cls(rays, tuple(first.tolist()), reach, begin, seen / count)

    @property
    def count(self) -> int:
        """S."""
        return len(self.first) - 1

    def of_scan(self, z: Scan) -> NDArray[np.float32]:
        """(S,): NaN for a sector without a reading that says something."""
        told = heard(z)
        values = np.log1p(np.minimum(z.ranges[told], self.reach))
        beyond = np.mod(z.angles[told] - self.begin, TURN) / self.width
        sector = np.minimum(beyond.astype(np.intp), self.count - 1)
        readings = np.bincount(sector, minlength=self.count)
        total = np.bincount(sector, values, minlength=self.count)
        with np.errstate(invalid="ignore"):
            features: NDArray[np.float32] = (total / readings).astype(np.float32)
        return features

    def of_rings(self, ranges: NDArray[np.float64], headings: int) -> NDArray[np.float32]:
        """(S, n, H): those of the scans that the sensor would take at n places, turned by 0, 2π /
        H, 4π / H …

        ranges: (n, rays), metres, from the rings around the places; inf for nothing within reach.
        H divides rays. Rays without an expected range, NaN, are left out of the mean; where all
        rays of a sector are, it is taken to be as far as the reach.
        """
        known = ~np.isnan(ranges)
        values = np.log1p(np.minimum(np.where(known, ranges, 0.0), self.reach))
        totals, counts = _running(values), _running(known)
        found = np.empty((self.count, len(ranges), headings), dtype=np.float32)
        for sector, (first, stop) in enumerate(pairwise(self.first)):
            begin, end = first % self.rays, first % self.rays + stop - first
            total, count = (
                _turned(sums, end, headings) - _turned(sums, begin, headings)
                for sums in (totals, counts)
            )
            mean = total / np.maximum(count, 1.0)
            found[sector] = np.where(count > 0.0, mean, np.log1p(self.reach))
        return found


def _running(values: NDArray[np.generic]) -> NDArray[np.float64]:
    """(n, 3 A + 1): the sum of the first 0, 1, 2 … of the values (n, A) of each row, three times
    around.
    """
    sums = np.zeros((len(values), 3 * values.shape[1] + 1))
    np.cumsum(np.tile(values, 3), axis=1, out=sums[:, 1:])
    return sums


def _turned(sums: NDArray[np.float64], ray: int, headings: int) -> NDArray[np.float64]:
    """(n, H): the sums before this ray of a sensor, for each heading."""
    rays = sums.shape[1] // 3
    return sums[:, ray : ray + rays : rays // headings]
