"""People: discs that walk about in free space, stop, and look at what there is to see.

Some go from place to place. Visitors go where the robot is about to be: they gather in front of it,
as they did around the first robots that guided them through museums.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.geometry import Poses
from mcloc.simulation.route import Roadmap, travelled, way_along
from mcloc.trajectory import Trajectory

RADIUS = 0.2  # m
SPEED = (0.7, 1.3)  # m/s, from one person to the other
SIGHTS = 24  # places that those go to and fro between who do not care for the robot
LOOK = (1.0, 8.0)  # s that they stand before they walk on
LEAD = 4.0  # s: visitors go where the robot will be by then
GATHER = (0.8, 2.5)  # m from it
BERTH = 0.6  # m from the robot: who would be nearer steps aside
ASIDE = 2.0  # m from the robot at most


class Crowd:
    """`n` people around a robot, a share of them visitors.

    roadmap: where they walk. robot: where it truly is. Raises ConfigError for n < 0 or a share
    that is not one.
    """

    def __init__(
        self,
        n: int,
        roadmap: Roadmap,
        robot: Trajectory,
        rng: np.random.Generator,
        *,
        visitors: float = 0.5,
    ) -> None:
        if n < 0 or not 0.0 <= visitors <= 1.0:
            raise ConfigError(f"people must be ≥ 0 and visitors from 0 to 1: {n} and {visitors}")
        self._roadmap = roadmap

        sights = [roadmap.toward(roadmap.random(rng)) for _ in range(SIGHTS if n else 0)]

        def to_a_sight(t: float, start: int) -> list[int]:
            return way_along(sights[rng.integers(SIGHTS)], start)

        def to_the_robot(t: float, start: int) -> list[int]:
            distance, bearing = rng.uniform(*GATHER), rng.uniform(-np.pi, np.pi)
            then = robot.at(np.array([t + LEAD]))[0, :2]
            goal = roadmap.nearest(then + distance * np.array([np.cos(bearing), np.sin(bearing)]))
            return [start, goal] if roadmap.sees(start, goal) else roadmap.way(start, goal)

        curious = round(visitors * n)
        ways = [to_the_robot] * curious + [to_a_sight] * (n - curious)
        self._walks = [_walk(roadmap, way, robot.t[-1], rng) for way in ways]

    def at(self, t: NDArray[np.float64], robot: Poses) -> NDArray[np.float64]:
        """(n, T, 2) where they are at the stamps t (T,), while the robot is at the poses (T, 3).

        NaN while somebody is in the robot's way and has no place to step aside.
        """
        places = np.empty((len(self._walks), len(t), 2))
        for k, (stamps, points) in enumerate(self._walks):
            places[k] = np.stack([np.interp(t, stamps, axis) for axis in points.T], axis=-1)
        in_the_way = np.hypot(*np.moveaxis(places - robot[:, :2], -1, 0)) < BERTH
        for k, i in np.argwhere(in_the_way):
            places[k, i] = self._aside(places[k, i], robot[i, :2])
        return places

    def _aside(
        self, person: NDArray[np.float64], robot: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The place nearest to a person that leaves the robot alone."""
        points = self._roadmap.points[self._roadmap.within(ASIDE, robot)]
        points = points[np.hypot(*(points - robot).T) >= BERTH]
        if not len(points):
            return np.full(2, np.nan)
        nearest: NDArray[np.float64] = points[np.hypot(*(points - person).T).argmin()]
        return nearest


def _walk(
    roadmap: Roadmap,
    next_way: Callable[[float, int], list[int]],
    end: float,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stamps (K,) and points (K, 2) of a person who walks one way after the other.

    next_way: the places to go by, at a stamp, from a place.
    """
    speed = rng.uniform(*SPEED)
    stamps, places = [0.0], [roadmap.random(rng)]
    while stamps[-1] < end:
        way = next_way(stamps[-1], places[-1])
        arrivals = stamps[-1] + travelled(roadmap.points[way]) / speed
        stamps += [*arrivals[1:], arrivals[-1] + rng.uniform(*LOOK)]
        places += [*way[1:], way[-1]]
    return np.array(stamps), roadmap.points[places]
