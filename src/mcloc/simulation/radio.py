"""Radio beacons on the walls of a world, and the ranges to them that a robot measures."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.events import BeaconRanges
from mcloc.geometry import Poses, compose
from mcloc.maps.beacons import Beacons
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.registry import Configurable, param
from mcloc.simulation.wall_places import wall_places


@dataclass(frozen=True)
class Radio(Configurable):
    """How many beacons there are, and how the ranges to them err; by default as the sensor model
    `BeaconModel` expects it.

    Radio goes through walls. Each beacon has a bias of its own, which stays: of the radio and the
    surveyed place. A share of the ranges comes by a detour and is late, a share is anything, and a
    share does not come. antenna: m ahead, to the left and up, on the robot.
    """

    beacons: int = param(4, "", "beacons on the walls", low=1, high=1000)
    height: float = param(2.0, "m", "of the beacons above the floor", low=0, high=100)
    sigma: float = param(0.1, "m", "deviation of a range", low=0, high=100)
    sigma_bias: float = param(0.2, "m", "deviation of the bias of a beacon", low=0, high=100)
    p_late: float = param(0.05, "", "share of ranges by a detour", low=0, high=0.9)
    late: float = param(1.0, "m", "mean detour", low=0, high=1e4)
    p_outlier: float = param(0.02, "", "share of ranges that are anything", low=0, high=0.9)
    missing: float = param(0.1, "", "share of ranges that do not come", low=0, high=1)
    range_max: float = param(50.0, "m", "longest range that is measured", above=0, high=1e5)
    antenna: tuple[float, float, float] = (0.1, 0.0, 0.5)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.p_late + self.p_outlier > 1.0:
            raise self.wrong(
                f"p_late + p_outlier must be at most 1, got {self.p_late + self.p_outlier:g}"
            )
        if np.shape(self.antenna) != (3,) or not np.isfinite(self.antenna).all():
            raise ConfigError(f"Radio.antenna must be x, y, z, got {self.antenna}")

    def placed(self, grid: OccupancyGrid, rng: np.random.Generator) -> Beacons:
        """Beacons 1, 2, … on the walls, far from each other. Raises MapError for too few walls."""
        chosen = wall_places(grid, self.beacons, rng)
        names = [str(k + 1) for k in range(self.beacons)]
        return Beacons(names, np.insert(chosen, 2, self.height, axis=1))

    def measure(
        self, beacons: Beacons, t: NDArray[np.float64], robot: Poses, rng: np.random.Generator
    ) -> Iterator[BeaconRanges]:
        """The ranges at each stamp t (N,) of a robot at the poses (N, 3); NaN where none comes."""
        ahead, left, up = self.antenna
        places = compose(robot, (ahead, left, 0.0))
        off = beacons.places[:, :2] - places[:, None, :2]
        d = np.hypot(np.hypot(off[..., 0], off[..., 1]), beacons.places[:, 2] - up)
        bias = self.sigma_bias * rng.standard_normal(len(beacons.names))
        fate = rng.random(d.shape)
        late = np.where(fate < self.p_late, rng.exponential(self.late, d.shape), 0.0)
        r = d + bias + self.sigma * rng.standard_normal(d.shape) + late
        anything = self.range_max * rng.random(d.shape)
        r = np.where(fate >= 1.0 - self.p_outlier, anything, r)
        lost = rng.random(d.shape) < self.missing
        r[lost | (r <= 0.0) | (r > self.range_max)] = math.nan
        every = np.arange(len(beacons.names))
        for stamp, ranges in zip(t.tolist(), r, strict=True):
            yield BeaconRanges(stamp, every, ranges, np.array(self.antenna))
