"""A run as a ROS 2 bag, to be looked at: map, path, pose, particles, and the scans behind them.

    /map             OccupancyGrid              once, latched
    /amcl_pose       PoseWithCovarianceStamped  each estimate
    /tf              map → odom → base_link     each estimate
    /tf_static       base_link → laser          once for each laser, latched
    /particle_cloud  PoseArray                  each update
    /<laser>         LaserScan                  each update: the scan that was used
    /path            Path                       each time it has doubled, and at the end

A path published at each estimate would make the bag grow with the square of the run's length.
"""

from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mcloc.events import Scan
from mcloc.geometry import Pose, Poses, compose, inverse
from mcloc.io.bag_writer import BASE, MAP, ODOM, BagWriter
from mcloc.localizer import Estimate
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.particles import Particles

MOST_PARTICLES = 2000  # in one message; more cannot be told apart on a screen


class Recording:
    """Records the estimates of a run within a `with` block; see BagWriter for folder and errors.

    Of the estimates only the path is kept in memory.
    """

    def __init__(self, folder: str | Path, grid: OccupancyGrid) -> None:
        self.grid = grid
        self._bag = BagWriter(folder)
        self._stamps: list[float] = []
        self._poses: list[Pose] = []
        self._published = 0

    def __enter__(self) -> Self:
        self._bag.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if len(self._poses) > self._published:
                self._publish_path()
        finally:
            self._bag.__exit__(kind, error, trace)

    def add(self, estimate: Estimate) -> None:
        """Record one estimate, and what it was made from where it is an update."""
        t, bag = estimate.t, self._bag
        if not self._poses:
            bag.grid("/map", t, self.grid)
        drift = compose(estimate.pose, inverse(estimate.odometry))
        bag.transform(t, MAP, ODOM, drift)
        bag.transform(t, ODOM, BASE, estimate.odometry)
        bag.pose("/amcl_pose", t, estimate.pose, estimate.covariance)
        if estimate.updated:
            if isinstance(estimate.measurement, Scan):
                bag.scan(estimate.measurement)
            bag.cloud("/particle_cloud", t, thinned(estimate.update.particles, MOST_PARTICLES))
        self._stamps.append(t)
        self._poses.append(estimate.pose)
        if len(self._poses) >= 2 * self._published:
            self._publish_path()

    def _publish_path(self) -> None:
        self._bag.path("/path", self._stamps, self._poses)
        self._published = len(self._poses)


def thinned(particles: Particles, most: int) -> Poses:
    """(n, 3), n ≤ most: equally weighted poses that lie as densely as the particles weigh.

    A systematic sweep with its teeth at (j + ½) / n: nothing of it is random.
    """
    n = min(len(particles), most)
    cumulative = np.cumsum(particles.weights)
    teeth = (np.arange(n) + 0.5) / n * cumulative[-1]
    picked: NDArray[np.intp] = np.searchsorted(cumulative, teeth)
    return particles.states[:, picked].T
