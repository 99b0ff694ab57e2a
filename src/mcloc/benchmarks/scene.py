"""What is measured on: a map, a scan taken from a place on it, and clouds of particles."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.events import Scan
from mcloc.geometry import Pose
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation.museum import museum_world
from mcloc.simulation.ranges import ranges

RANGE_MAX = 10.0  # m
SEED = 1
DEMO_WORLD = 4
SPREAD = np.array([0.15, 0.15, 0.05])  # m, m, rad, of a tracked robot
CLOUDS = ("tracking", "uniform")
MOVE = np.array([0.2, 0.0, 0.05])  # m, m, rad


def demo_map() -> OccupancyGrid:
    """The museum of `make demo`: 620 × 820 cells of 0.05 m."""
    return museum_world(DEMO_WORLD)


@dataclass(frozen=True, eq=False)
class Scene:
    """A map without a turn (its yaw is left out), and what happens on it; all from one seed."""

    grid: OccupancyGrid

    @classmethod
    def on(cls, grid: OccupancyGrid) -> "Scene":
        """The reference knows no turned maps."""
        return cls(replace(grid, origin=np.array([*grid.origin[:2], 0.0])))

    @cached_property
    def floor(self) -> FreeSpace:
        """Where the robot can stand."""
        return FreeSpace(self.grid)

    @cached_property
    def pose(self) -> Pose:
        """(3,): the first of some places by chance from which most beams return."""
        tried = self.floor.sample(Draws(SEED), 0, 200)
        ahead = np.linspace(-np.pi / 2.0, np.pi / 2.0, 60)
        seen = np.isfinite(ranges(self.grid, tried.T, ahead, RANGE_MAX)).mean(axis=1) > 0.75
        place: Pose = tried[:, int(seen.argmax())]
        return place

    def scan(self, beams: int) -> Scan:
        """A perfect scan from there, over half the circle."""
        angles = np.linspace(-np.pi / 2.0, np.pi / 2.0, beams)
        return Scan(0.0, ranges(self.grid, self.pose, angles, RANGE_MAX)[0], angles, RANGE_MAX)

    def cloud(self, name: str, n: int) -> NDArray[np.float64]:
        """(3, n): particles of a tracked robot, or all over the floor."""
        if name == "uniform":
            return self.floor.sample(Draws(SEED, 1), 0, n)
        noise = np.random.default_rng(SEED).standard_normal((3, n))
        return self.pose[:, None] + SPREAD[:, None] * noise
