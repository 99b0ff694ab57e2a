"""Landmarks on the walls of a world, and a camera that recognizes them."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mcloc.events import Detection
from mcloc.geometry import Poses
from mcloc.io.mrclam import ROBOTS
from mcloc.maps.landmarks import Landmarks
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.registry import Configurable, param
from mcloc.simulation.team_drive import Spotter
from mcloc.simulation.wall_places import wall_places


@dataclass(frozen=True)
class Lookout(Configurable):
    """How many landmarks there are, and how they are seen: as `Spotter` sees robots, but nearly as
    precisely as the sensor model of landmarks expects it.
    """

    landmarks: int = param(20, "", "landmarks on the walls", low=1, high=1000)
    camera: Spotter = field(
        default_factory=lambda: Spotter(sigma_range=0.1, sigma_bearing=0.02, p_false=0.01)
    )

    def placed(self, grid: OccupancyGrid, rng: np.random.Generator) -> Landmarks:
        """Landmarks far from each other, with numbers that are not those of robots. Raises MapError
        for too few walls.
        """
        names = [str(ROBOTS + 1 + k) for k in range(self.landmarks)]
        return Landmarks(names, wall_places(grid, self.landmarks, rng))

    def look(
        self,
        grid: OccupancyGrid,
        landmarks: Landmarks,
        t: NDArray[np.float64],
        robot: Poses,
        rng: np.random.Generator,
    ) -> list[Detection]:
        """What is seen at the stamps t (N,) from the poses (N, 3), in order of time."""
        seen: list[Detection] = []
        for name, place in zip(landmarks.names, landmarks.places, strict=True):
            there = np.tile([*place, 0.0], (len(t), 1))
            seen += self.camera.look(grid, t, robot, there, name, rng)
        return sorted(seen, key=lambda detection: detection.t)
