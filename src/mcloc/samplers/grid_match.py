"""q̄(x) = Σ_i β_i N(x; μ_i, Λ) over the points of a grid, each with the heading at which what it
sees is most like the scan  [Yee §4, Eq. 7].
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws, Stream
from mcloc.errors import MapError
from mcloc.events import Scan
from mcloc.geometry import wrap
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.particles import log_sum_exp
from mcloc.protocols import Environment, SensorModel
from mcloc.registry import Configurable, param
from mcloc.samplers.found_poses import robot_at
from mcloc.samplers.pose_boxes import PoseBoxes
from mcloc.samplers.pose_mixture import PoseMixture, Spread
from mcloc.samplers.rings import Rings
from mcloc.samplers.scan_features import heard
from mcloc.sensors.beam_model import BeamModel
from mcloc.statespace import LogWeights, States

BULK = 0.99  # of the mass, which the components that are kept have
MOST_REACHES = 4  # of lasers, for which rings are kept


@dataclass(frozen=True)
class GridMatch(Configurable):
    """Poses of a robot from one scan, for any sensor model of scans.

    Where to look. Each square of `spacing` that has a free cell has a point, the free cell nearest
    to its middle, and of each point it is worked out once what a sensor there would see all around:
    a ring of `headings` sectors (samplers/rings). A scan is laid around each ring at all headings,
    and the one where it differs least is the heading of that point. They differ by the sum of the
    absolute differences of log(1 + r) over the sectors that the scan has readings in, whatever its
    field of view: a person spoils a few of them, not all. Sensors of one reach share the rings.
    Where the sensor model has cones, as of sonars, a sensor there sees the nearest wall in them.

    Of 100 scans of each of the 6 recorded logs, at random moments, so many had a point within
    `spacing` along both axes, with a heading within 10 degrees, among those that differed least

        250: 75 %    1000: 92 %    2000: 96 %    4000: 97 %    of all points: 98 %

    and with squared differences 71, 87, 89, 92 and 94 %. These alone can be had by Fourier
    transforms, which took 4 … 7 ms on one thread, and 10 times the memory, where the loop over all
    headings took 3.5 … 6 ms (13,000 … 20,000 points, half of 90 sectors).

    What is there. Of the `components` points that differ least each has a Gaussian around its pose,
    with deviations of `spread` steps of the grid along x, y and heading, cut off at 3 of them. The
    paper weighs it by p(z | μ_i). A likelihood may be too sharp for that: 0.25 m beside the robot
    the endpoints of its scan are 2.5 σ_hit off the walls. So here β_i ∝ ∫ N(x; μ_i, Λ) p(z | x)
    p(x | m) dx, by the mean over `looks` poses of the component. Components of a grid overlap
    evenly; then that is the first step of EM from equal weights, and where Λ is small it is the
    paper's weight. The fewest components with 99 % of the mass are kept: 10 … 300, or 1200 in a
    corridor. A share `floor` of q̄ is U, since a scan may be like none of its place: it bounds
    importance weights wherever a robot can be.

    On the same scans q̄ had 10 % or more within 0.5 m and 10° of the truth in so many, where it is
    weighed by p(z | μ_i) with components at all points,

                            fhw   freiburg-079   intel   wean-1   wean-3   wean-4
        here                97 %      96 %       96 %      9 %     17 %     35 %
        p(z | μ_i)          94 %      94 %       93 %     10 %     17 %     32 %
        here, 0.5 m         90 %      72 %       87 %      7 %     11 %     21 %
        p(z | μ_i), 0.5 m   80 %      53 %       67 %     12 %     10 %     25 %
        feature tree        95 %      97 %       95 %      9 %     16 %     25 %

    and 1 % or more in 99, 98, 98, 72, 81 and 92 %. wean is a corridor that looks the same for 30 m.

    Looking around took 0.2 … 0.3 s and 1.5 … 2.3 MB, a scan 6.5 … 11 ms on one thread, as long as
    with the feature tree; with the exact rays of a beam model 0.8 times as long.

    Of a map with more than `memory` / `headings` squares of `spacing` the squares are made larger,
    in whole cells, until the rings of their points fit: 14,000 m² of free space by default. The
    time of a scan grows with the points as well, 0.3 µs for each.
    """

    grid: OccupancyGrid
    sensor: SensorModel
    environment: Environment
    spacing: float = param(
        0.25, "m", "between points, to whole cells; more where memory asks", low=0.01, high=100
    )
    headings: int = param(90, "", "directions in which a point is looked around", low=8, high=256)
    spread: float = param(
        0.4, "", "deviation of poses from a point, in spacings and headings", low=0.1, high=2
    )
    components: int = param(2000, "", "points that are most like a scan", low=1, high=1e6)
    looks: int = param(8, "", "poses at which a component is weighed", low=1, high=1000)
    floor: float = param(0.1, "", "share of poses from anywhere", above=0, high=1)
    memory: float = param(20.0, "MB", "most memory of the rings for a laser", above=0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.grid.free.any():
            raise MapError(
                f"{self.grid.name}: no free cell to stand on; check free_thresh and negate"
            )
        if self._most_points < 1:
            raise self.wrong(
                f"memory = {self.memory:g} MB does not hold the {self.headings} directions of a "
                "single point"
            )

    def prepare(self, z: Scan) -> None:
        """Look around at all points, once for each reach of a laser."""
        self._rings_of(z).rings  # noqa: B018

    def given(self, z: Scan, draws: Draws) -> PoseMixture:
        """The density for one scan; uniform where no reading of it says anything.

        draws: for looking; samples of the density take others. Raises FilterError for a likelihood
        that is NaN.
        """

        def fit(x: States) -> LogWeights:
            return self.sensor.log_likelihood(x, z) + self.environment.log_prior(x)

        means, weights = np.empty((3, 0)), np.empty(0)
        if heard(z).any():
            means = self._best(z)
            count = means.shape[1]
            within = draws.uniform(Stream.TREE, 0, count * self.looks)[:3]
            look = self._spread.around(np.repeat(means, self.looks, axis=1), within)
            log_p = fit(robot_at(look, z.mount))
            total = log_sum_exp(log_p)
            if total > -math.inf:
                weights = np.exp(log_p - total).reshape(count, self.looks).sum(axis=1)
                kept = bulk(weights)
                means, weights = means[:, kept], weights[kept] / weights[kept].sum()
            else:
                means = means[:, :0]
        model = means, weights, self._spread, self.environment, self.floor, z.mount
        return PoseMixture(*model, fit, draws, self.components * self.looks)

    def _best(self, z: Scan) -> States:
        """(3, M): the points that are most like z, each with the heading at which it is."""
        turns, apart = self._rings_of(z).match(z)
        best = np.arange(len(apart))
        if self.components < len(apart):
            best = np.sort(np.argpartition(apart, self.components)[: self.components])
        means = self._points[:, best]
        means[2] = wrap(means[2] + 2.0 * np.pi / self.headings * turns[best])
        return means

    def _rings_of(self, z: Scan) -> Rings:
        height, width = self.grid.cells.shape
        reach = min(z.range_max, self.grid.resolution * float(np.hypot(height, width)))
        if reach not in self._rings:
            if len(self._rings) == MOST_REACHES:
                self._rings.clear()
            cone = self.sensor.cone if isinstance(self.sensor, BeamModel) else 0.0
            self._rings[reach] = Rings(self.grid, self._points, self.headings, reach, cone)
        return self._rings[reach]

    @cached_property
    def _rings(self) -> dict[float, Rings]:
        return {}

    @cached_property
    def squares(self) -> PoseBoxes:
        """Those that have a point each where they have a free cell: `spacing` wide, or so wide that
        the rings of all points fit into `memory`.
        """
        cells = max(round(self.spacing / self.grid.resolution), 1)
        while True:
            squares = PoseBoxes(self.grid, cells, 1)
            too_many = squares.count_free_squares() / self._most_points
            if too_many <= 1.0:
                return squares
            cells = math.ceil(cells * max(math.sqrt(too_many), 1.01))

    @property
    def _most_points(self) -> int:
        """Whose rings fit into `memory`."""
        return int(1e6 * self.memory / self.headings)

    @cached_property
    def _points(self) -> States:
        """(3, n): heading along the map's own x axis."""
        return self.squares.free_squares()[1]

    @cached_property
    def _spread(self) -> Spread:
        """Λ: the same number of steps of the grid along all axes."""
        side = float(self.squares.sides(0)[0])
        return Spread(self.spread * side, self.spread * 2.0 * np.pi / self.headings)


def bulk(weights: NDArray[np.float64]) -> NDArray[np.intp]:
    """Which weights (n,), whose sum is 1, are the fewest with the bulk of it, in their order."""
    largest = np.argsort(-weights, kind="stable")
    enough = int(np.searchsorted(np.cumsum(weights[largest]), BULK)) + 1
    return np.sort(largest[:enough])
