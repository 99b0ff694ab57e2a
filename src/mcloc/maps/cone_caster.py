"""e = min_φ e(φ) over the directions φ of a cone: a sonar measures the nearest wall in its beam
[Yee §2].
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import minimum_filter1d

from mcloc.geometry import Pose
from mcloc.maps.ray_caster import RayCaster
from mcloc.statespace import States

APART = math.radians(4.0)  # between two rays at most: what is 0.2 m wide is seen from 3 m


@dataclass(frozen=True, eq=False)
class ConeCaster:
    """Casts a fan of rays for each beam, at most 4° apart, and takes the nearest wall.

    rays: casts each of them. cone: radians, the opening angle; both edges have a ray.

    Where a part of the cone leaves known space, the rest of it counts: maps have unknown cells
    beside most walls, and a cone that touches some would else say nothing. There is no expected
    range where all of the cone leaves known space.
    """

    rays: RayCaster
    cone: float

    def ranges(
        self, x: States, mount: Pose, angles: ArrayLike, range_max: float
    ) -> NDArray[np.float64]:
        """(n, B): expected ranges in metres, inf where no wall is nearer than range_max, NaN where
        all of the cone leaves known space before. Arguments as of `RayCaster.ranges`.
        """
        return reduce(np.fmin, self._fan(x, mount, angles, range_max))

    def sum(
        self,
        x: States,
        mount: Pose,
        angles: ArrayLike,
        range_max: float,
        table: NDArray[np.float32],
        spacing: float,
    ) -> NDArray[np.float64]:
        """(n,): Σ over the beams of a function of the expected range, as `RayCaster.sum`."""
        at = self.ranges(x, mount, angles, range_max) / spacing
        beyond, found = table.shape[1] - 2, at < np.inf
        knot = np.where(found, np.minimum(at, beyond - 2), beyond + np.isnan(at)).astype(np.intp)
        beams, after = np.arange(len(table)), np.where(found, knot + 1, knot)
        here, there = table[beams, knot], table[beams, after]
        total: NDArray[np.float64] = np.sum(
            here + np.where(found, at - knot, 0.0) * (there - here), axis=1
        )
        return total

    def _fan(
        self, x: States, mount: Pose, angles: ArrayLike, range_max: float
    ) -> Iterator[NDArray[np.float64]]:
        """(n, B) of one ray of each beam after the other."""
        intervals = 2 * math.ceil(self.cone / (2.0 * APART))
        for aside in np.linspace(-self.cone / 2.0, self.cone / 2.0, 1 + intervals):
            yield self.rays.ranges(x, mount, np.asarray(angles) + aside, range_max)


def nearest_around(lengths: NDArray[np.float64], aside: int) -> NDArray[np.float64]:
    """(n, D): the least of each length (n, D) and of its `aside` neighbours to both sides, all
    around the circle; NaN where all of them are NaN.
    """
    known = np.where(np.isnan(lengths), np.inf, lengths)
    nearest = minimum_filter1d(known, 1 + 2 * aside, axis=1, mode="wrap")
    least: NDArray[np.float64] = np.where(np.isinf(nearest), np.nan, nearest)
    return least
