"""q̄(x) ≈ p(z | x) / π(z) for range finders: simulated scans that are like the real one say where to
look, the likelihood says what is there  [Fox01 §19.3.2].
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws, Stream
from mcloc.errors import MapError
from mcloc.events import Scan
from mcloc.kernels.jit import share
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.maps.ray_caster import RayCaster
from mcloc.particles import log_sum_exp
from mcloc.protocols import Environment, SensorModel
from mcloc.registry import Configurable, param
from mcloc.samplers.found_poses import Found, FoundPoses, robot_at
from mcloc.samplers.pose_boxes import PARTS, Keys, PoseBoxes
from mcloc.samplers.scan_features import Sectors, heard
from mcloc.statespace import LogWeights, States

RAY = np.deg2rad(1.0)  # between the rays of a ring, about
MOST_LASERS = 4  # for which features are kept
_AT_ONCE = 1 << 18  # rays
_SOME = 16  # of how many distances one is looked at first


@dataclass(frozen=True)
class FeatureTree(Configurable):
    """Poses of a robot from one scan, for any sensor model of scans.

    Where to look. One place in each square of `spacing` that has a free cell is asked for the
    ranges all around it; the scan of each heading is a turn of that ring. Of a scan each sector has
    the mean of log(1 + r): a difference matters relative to how far the wall is, and a person
    shortens some sectors, not all. Scans differ by the sum of the absolute differences, in which a
    sector that is wrong counts for as much as it is wrong. The boxes of poses around the nearest
    simulated scans are looked into, spacing × spacing × 2π / headings each.

    Rays pass unknown cells until they meet a wall: the next surface that the map knows is a better
    guess than none. Those that leave the map are left out of the mean; a sector of such rays alone
    is as far as the reach. No return counts as the reach, range_max; errors of the laser are left
    out, and so is a sector without other readings.

    Of 100 scans of each of the 6 recorded logs, at random moments, so many had the true box or one
    beside it among the nearest

        300: 88 %    1000: 97 %    2000: 98 %    4000: 99 %

    and among 2000 there were 94 % with squared differences, 96 % and 82 % with r and 1 / (1 + r)
    in place of log(1 + r). Of 480 others it was 92 % instead of 98 % where rays that leave the map
    count as no return (72 % instead of all in the museum fhw), with 12 sectors. 12 or 24 sectors,
    30 or 45 headings make less than 1 % of difference.

    What is there. One pose is drawn in each of the 8 parts of each box and weighed by p(z | x)
    p(x | m); the `refined` best parts are cut in 8 again. Each look stands for an equal share of
    its part. A share `floor` of q̄ is U, since a scan may be like none of its place: it bounds
    importance weights wherever a robot can be. Left to it are the poses that fit without being
    found, which have a fifth to a half of ∫ p(z | x) dx: of samples of q̄ weighed by p(z | x) / q̄
    the ESS is 2 … 5 %; without the second cut, on 240 others, 1 … 4 % (2 % instead of 3 %).

    On the same scans q̄ had 10 % or more within 0.5 m and 10° of the truth in 99 % (fhw), 89 %
    (freiburg-079) and 95 % (intel); 1 % or more in 67 %, 79 % and 95 % (wean-1, 3, 4), a corridor:
    of 40 scans each, p(z | x) / π itself had so much there in 60 %, 80 % and 82 %.

    A scan took 7 … 11 ms on one thread; with the exact rays of a beam model 45 … 65 ms on two.
    Simulating took 0.1 … 0.4 s and 9 … 20 MB, and 0.6 s and 36 MB for 50 × 50 m of free space. That
    is too little to keep it in a file, which would have to be held to map and settings. Of a map
    with more than 14,000 m² of free space the features would pass `memory`: its places lie farther
    apart, and a scan is the less likely to find its own.

    The papers put features into a kd-tree, which the name recalls. Asked for 2000 neighbours in 16
    dimensions SciPy's took 18 … 32 ms; comparing all of 300,000 scans takes 2.5 ms.
    """

    grid: OccupancyGrid
    sensor: SensorModel
    environment: Environment
    spacing: float = param(
        0.4, "m", "between places of simulated scans; more where memory asks", low=0.01, high=100
    )
    headings: int = param(36, "", "simulated scans at a place", low=4, high=720)
    sectors: int = param(16, "", "features of a scan, at most", low=1, high=360)
    neighbours: int = param(2000, "", "boxes that a scan is looked for in", low=1, high=1e6)
    refined: int = param(1000, "", "parts of boxes that are looked into again", low=1, high=1e6)
    floor: float = param(0.1, "", "share of poses from anywhere", above=0, high=1)
    memory: float = param(200.0, "MB", "most memory of the features for a laser", above=0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.grid.free.any():
            raise MapError(
                f"{self.grid.name}: no free cell to stand on; check free_thresh and negate"
            )
        if self._most_places < 1:
            raise self.wrong(
                f"memory = {self.memory:g} MB does not hold the {self.sectors} features of scans "
                f"in {self.headings} headings at a single place"
            )

    def prepare(self, z: Scan) -> None:
        """Simulate the scans of the laser that z comes from, once for each kind of laser."""
        if len(z.angles) > 0:
            self._features_of(self._sectors_of(z))

    def given(self, z: Scan, draws: Draws) -> FoundPoses:
        """The density for one scan; uniform where no reading of it says anything.

        draws: for looking; samples of the density take others. Raises FilterError for a likelihood
        that is NaN.
        """

        def fit(x: States) -> LogWeights:
            return self.sensor.log_likelihood(x, z) + self.environment.log_prior(x)

        def look(keys: Keys, level: int, first: int) -> LogWeights:
            within = draws.uniform(Stream.TREE, first, len(keys))[:3]
            return fit(robot_at(self.boxes.poses(keys, level, within), z.mount))

        found: tuple[Found, ...] = ()
        if heard(z).any():
            parts = self.boxes.parts(self._nearest(z), 0)
            coarse = look(parts, 1, 0)
            best = np.argsort(-coarse, kind="stable")[: self.refined]
            pieces = self.boxes.parts(parts[best], 1)
            fine = look(pieces, 2, len(parts)) - np.log(1.0 + PARTS)
            coarse[best] -= np.log(1.0 + PARTS)
            total = log_sum_exp(np.concatenate([coarse, fine]))
            if total > -np.inf:
                masses = np.exp(coarse - total), np.exp(fine - total)
                found = Found(1, parts, masses[0]), Found(2, pieces, masses[1])
        looks = PARTS * (self.neighbours + self.refined)
        model = self.boxes, self.environment
        return FoundPoses(*model, found, self.floor, z.mount, fit, draws, looks)

    @cached_property
    def boxes(self) -> PoseBoxes:
        """Those that the sensor is looked for in, at level 0: `spacing` wide, or so wide that the
        features of all of them fit into `memory`.
        """
        cells = max(round(self.spacing / self.grid.resolution), 1)
        while True:
            boxes = PoseBoxes(self.grid, cells, self.headings)
            too_many = boxes.count_free_squares() / self._most_places
            if too_many <= 1.0:
                return boxes
            cells = math.ceil(cells * max(math.sqrt(too_many), 1.01))

    @property
    def _most_places(self) -> int:
        """Whose features fit into `memory`."""
        return int(self.memory / (4e-6 * self.headings * self.sectors))

    def _nearest(self, z: Scan) -> Keys:
        """The boxes of the simulated scans that are most like z."""
        sectors = self._sectors_of(z)
        simulated, real = self._features_of(sectors), sectors.of_scan(z)
        used = np.flatnonzero(~np.isnan(real))
        apart = np.zeros(simulated.shape[1], dtype=np.float32)

        def run(start: int, stop: int) -> None:
            difference = np.empty(stop - start, dtype=np.float32)
            for sector in used:
                np.subtract(simulated[sector, start:stop], real[sector], out=difference)
                np.abs(difference, out=difference)
                apart[start:stop] += difference

        share(run, len(apart), 0.4 * len(apart) * len(used))
        place, heading = np.divmod(least(apart, self.neighbours), self.headings)
        keys: Keys = self._places[0][place] * self.headings + heading
        return keys

    def _sectors_of(self, z: Scan) -> Sectors:
        a_turn = max(round(2.0 * np.pi / self.headings / RAY), 1)
        height, width = self.grid.cells.shape
        across = self.grid.resolution * float(np.hypot(height, width))
        reach = min(z.range_max, across)
        return Sectors.of(z.angles, self.sectors, self.headings * a_turn, reach)

    def _features_of(self, sectors: Sectors) -> NDArray[np.float32]:
        """`_simulate`, done once."""
        if sectors not in self._simulated:
            if len(self._simulated) == MOST_LASERS:
                self._simulated.clear()
            self._simulated[sectors] = self._simulate(sectors)
        return self._simulated[sectors]

    @cached_property
    def _simulated(self) -> dict[Sectors, NDArray[np.float32]]:
        return {}

    def _simulate(self, sectors: Sectors) -> NDArray[np.float32]:
        """(S, places · headings): the features of all simulated scans."""
        passable = np.where(self.grid.unknown, np.int8(0), self.grid.cells)
        rays = RayCaster(replace(self.grid, cells=passable))
        _, x = self._places
        features = np.empty((sectors.count, x.shape[1], self.headings), dtype=np.float32)
        angles = 2.0 * np.pi / sectors.rays * np.arange(sectors.rays)
        together = max(_AT_ONCE // sectors.rays, 1)
        for first in range(0, x.shape[1], together):
            some = slice(first, first + together)
            ranges = rays.ranges(x[:, some], np.zeros(3), angles, sectors.reach)
            features[:, some] = sectors.of_rings(ranges, self.headings)
        return features.reshape(sectors.count, -1)

    @cached_property
    def _places(self) -> tuple[Keys, States]:
        return self.boxes.free_squares()


def least(values: NDArray[np.float32], count: int) -> NDArray[np.intp]:
    """Where the `count` least values are, or all of them where there are no more.

    A few values tell what is certainly not among them, in 0.5 ms instead of 2.7 for 300,000.
    """
    if count >= len(values):
        return np.arange(len(values))
    some = values[::_SOME]
    rank = 2 * count // _SOME + 32
    near = np.flatnonzero(values <= np.partition(some, rank)[rank]) if rank < len(some) else None
    if near is None or len(near) < count:
        near = np.arange(len(values))
    return near[np.argpartition(values[near], count - 1)[:count]]
