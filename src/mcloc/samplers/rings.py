"""What a range finder would see all around at each of some places, as rings of sectors: scans of
every heading are turns of a ring  [Yee §4].
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.events import Scan
from mcloc.kernels.jit import share
from mcloc.kernels.rings import best_turns
from mcloc.maps.cone_caster import nearest_around
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.maps.ray_caster import RayCaster
from mcloc.samplers.scan_features import TURN, Sectors
from mcloc.statespace import States

RAY = np.deg2rad(1.0)  # between the rays that a sector is the mean of, about
STEPS = 255  # of the logarithm, up to that of the reach
_AT_ONCE = 1 << 18  # rays
_HAIR = 1e-6  # rays
_WORK = 0.08  # ns for a turn of one sector


@dataclass(frozen=True, eq=False)
class Rings:
    """The rings around places (3, n), each of `count` sectors from the place's own heading on, the
    first of which lies half on either side of it.

    Of a sector it is the mean of log(1 + r) that is held, to 1/255 of that of the reach: below 2 %
    of a range. Rays pass unknown cells until they meet a wall, and those that leave the map are
    left out, as samplers/feature_tree tells. reach: metres, nothing is taken to be farther. cone:
    radians, the opening angle of the beams of a sonar: each ray then has the range of the nearest
    wall in it; its edges are rounded to rays.
    """

    grid: OccupancyGrid
    places: States
    count: int
    reach: float
    cone: float = 0.0

    def match(self, z: Scan) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """(n,) and (n,): by how many sectors a sensor at each place has to be turned to the left
        for its scan to be most like z; and how much they differ then, the sum of the absolute
        differences of all sectors in which z has a reading that says something.
        """
        seen = self.sectors.of_scan(z)
        used = np.flatnonzero(~np.isnan(seen))
        values = self._codes(seen[used]).astype(np.int16)
        turns = np.empty(len(self.rings), dtype=np.int32)
        apart = np.empty(len(self.rings), dtype=np.int32)

        def run(start: int, stop: int) -> None:
            best_turns(self.rings, used, values, turns, apart, start, stop)

        share(run, len(turns), _WORK * len(turns) * self.count * (len(used) + 4))
        return turns, apart

    @cached_property
    def sectors(self) -> Sectors:
        """All around, so that those of a scan with a narrower field are partly empty. Rays and
        beams between two are of the one to the left, also if rounding has them a hair to the right.
        """
        width = TURN / self.count
        rays = self.count * max(round(width / RAY), 1)
        edges = (np.arange(self.count + 1) - 0.5) * (rays // self.count) - _HAIR
        first = tuple(np.ceil(edges).astype(int).tolist())
        return Sectors(rays, first, self.reach, float(edges[0]) * TURN / rays, width)

    @cached_property
    def rings(self) -> NDArray[np.uint8]:
        """(n, count): one byte a sector; worked out when they are first asked for."""
        passable = np.where(self.grid.unknown, np.int8(0), self.grid.cells)
        rays = RayCaster(replace(self.grid, cells=passable))
        angles = TURN / self.sectors.rays * np.arange(self.sectors.first[0], self.sectors.first[-1])
        rings = np.empty((self.places.shape[1], self.count), dtype=np.uint8)
        together = max(_AT_ONCE // self.sectors.rays, 1)
        for first in range(0, len(rings), together):
            some = slice(first, first + together)
            ranges = rays.ranges(self.places[:, some], np.zeros(3), angles, self.reach)
            if self.cone > 0.0:
                aside = round(self.cone / 2.0 * self.sectors.rays / TURN)
                ranges = nearest_around(np.minimum(ranges, self.reach), aside)
            rings[some] = self._codes(self._means(ranges.astype(np.float32)))
        return rings

    def _means(self, ranges: NDArray[np.float32]) -> NDArray[np.float32]:
        """(n, count): of log(1 + r) over the rays of each sector (n, count · rays in one); that of
        the reach where all of them leave the map.
        """
        values = np.log1p(np.minimum(ranges, np.float32(self.reach)))
        values = values.reshape(len(ranges), self.count, -1)
        known = ~np.isnan(values)
        rays = known.sum(axis=2, dtype=np.float32)
        total = np.where(known, values, np.float32(0.0)).sum(axis=2)
        far = np.float32(np.log1p(self.reach))
        means: NDArray[np.float32] = np.where(rays > 0, total / np.maximum(rays, 1), far)
        return means

    def _codes(self, values: NDArray[np.float32]) -> NDArray[np.uint8]:
        codes: NDArray[np.uint8] = np.rint(values * (STEPS / np.log1p(self.reach))).astype(np.uint8)
        return codes
