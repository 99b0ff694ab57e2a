"""A small room, and scans of a robot in it."""

import numpy as np
import pytest

from mcloc.events import Scan
from mcloc.filters.catalog import Composition
from mcloc.geometry import between, compose
from mcloc.kernels import jit
from mcloc.localizer import Localizer
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.simulation import ranges

ANGLES = np.linspace(-np.pi / 2, np.pi / 2, 61)


class World:
    """5 m × 3 m with a pillar, at 0.05 m; nobody knows what lies outside."""

    start = np.array([1.2, 0.9, 0.3])

    def __init__(self) -> None:
        cells = np.full((80, 120), UNKNOWN, dtype=np.int8)
        cells[10:70, 10:110] = OCCUPIED
        cells[12:68, 12:108] = FREE
        cells[46:54, 76:88] = OCCUPIED
        self.grid = OccupancyGrid(cells, 0.05, np.array([-0.5, -0.5, 0.0]), name="room")

    def scan(self, t, pose, odometry=None, source="laser", mount=(0.0, 0.0, 0.0)):
        """What a perfect laser on a robot at `pose` measures."""
        sensor = compose(pose, mount)
        seen = ranges(self.grid, sensor[None], ANGLES, 8.0)[0]
        return Scan(t, seen, ANGLES, 8.0, mount=np.array(mount), odometry=odometry, source=source)

    def path(self, u, n):
        """(n, 3): poses of a robot that makes the move u again and again."""
        poses = [self.start]
        for _ in range(n - 1):
            poses.append(compose(poses[-1], u))
        return np.array(poses)

    def scans(self, poses, **options):
        """Scans that bring their odometry along, which is the truth seen from elsewhere."""
        return [
            self.scan(float(t), p, between([7.0, -2.0, 1.0], p), **options)
            for t, p in enumerate(poses)
        ]

    def localizer(self, particles=300, **options):
        few = Composition(size="fixed", settings={"size": {"particles": particles}})
        return Localizer(self.grid, few, **{"seed": 1, "initial": self.start, **options})


@pytest.fixture(scope="session")
def world():
    return World()


@pytest.fixture
def set_threads():
    before = jit._threads
    yield jit.set_threads
    jit.set_threads(before)
