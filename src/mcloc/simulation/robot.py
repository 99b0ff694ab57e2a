"""A robot to simulate: how it drives along a route, what its wheels and its laser report."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.errors import ConfigError
from mcloc.geometry import Poses, between, compose, wrap
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation.ranges import ranges
from mcloc.trajectory import Trajectory

STEP = 0.05  # s between two poses of a drive
LOOKAHEAD = 0.4  # m from the robot to the point of the route that it steers for
TURN_GAIN = 2.0  # rad/s for each radian between its heading and that point
TURN_MAX = 1.0  # rad/s


def follow(route: ArrayLike, speed: float) -> Trajectory:
    """The drive of a robot that steers along the route, a pose each 0.05 s from t = 0 s on.

    route: (K, 2) metres, map frame. speed: m/s straight ahead; the robot slows down to turn, and
    turns on the spot for what lies behind it. Raises ConfigError for a route that leads nowhere.
    """
    points = np.asarray(route, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise ConfigError(f"a route is a table of finite x, y, got shape {points.shape}")
    if not speed > 0.0:
        raise ConfigError(f"speed must be > 0 m/s, got {speed}")
    x, y = points[0]
    target = _ahead(points, 0, x, y)
    if np.hypot(*(points[target] - points[0])) <= LOOKAHEAD:
        raise ConfigError(f"the route does not lead {LOOKAHEAD} m away from its start")
    heading = np.arctan2(points[target, 1] - y, points[target, 0] - x)
    poses = [(x, y, heading)]
    while target < len(points) - 1 or np.hypot(*(points[target] - (x, y))) > LOOKAHEAD:
        off = float(wrap(np.arctan2(points[target, 1] - y, points[target, 0] - x) - heading))
        heading += STEP * np.clip(TURN_GAIN * off, -TURN_MAX, TURN_MAX)
        ahead = STEP * speed * max(0.0, np.cos(off))
        x, y = x + ahead * np.cos(heading), y + ahead * np.sin(heading)
        poses.append((x, y, heading))
        target = _ahead(points, target, x, y)
    path = np.array(poses)
    path[:, 2] = wrap(path[:, 2])
    return Trajectory(STEP * np.arange(len(path), dtype=np.float64), path)


def _ahead(points: NDArray[np.float64], start: int, x: float, y: float) -> int:
    """Index of the first point from `start` on that is not near (x, y), or the last point."""
    far = np.hypot(*(points[start:] - (x, y)).T) > LOOKAHEAD
    return start + int(far.argmax()) if far.any() else len(points) - 1


@dataclass(frozen=True, slots=True)
class Wheels:
    """How wheels misjudge a drive: by errors that stay, and by random ones.

    Variances grow in proportion to the distance or the turn, so that the error of a drive does not
    depend on how finely it is cut into steps.
    """

    scale: float = 0.02  # excess of each distance and turn
    drift: float = 0.01  # rad to the left for each metre
    sigma_distance: float = 0.03  # m after 1 m
    sigma_turn: float = 0.03  # rad after a turn by 1 rad
    sigma_drift: float = 0.02  # rad after 1 m

    def __post_init__(self) -> None:
        if not all(s >= 0.0 for s in (self.sigma_distance, self.sigma_turn, self.sigma_drift)):
            raise ConfigError(f"standard deviations of wheels must be ≥ 0: {self}")

    def measure(self, truth: Poses, rng: np.random.Generator) -> Poses:
        """(N, 3) odometry of a drive through the poses `truth` (N, 3); its frame starts at 0."""
        ahead, left, turn = between(truth[:-1], truth[1:]).T
        distance = np.hypot(ahead, left)
        along, about, astray = rng.standard_normal((3, len(turn)))
        ahead = (1.0 + self.scale) * ahead + self.sigma_distance * np.sqrt(distance) * along
        turn = (
            (1.0 + self.scale) * turn
            + self.drift * distance
            + self.sigma_turn * np.sqrt(np.abs(turn)) * about
            + self.sigma_drift * np.sqrt(distance) * astray
        )

        odometry = np.zeros_like(truth)
        heading = np.concatenate([[0.0], np.cumsum(turn)])
        odometry[:, 2] = wrap(heading)
        cos, sin = np.cos(heading[:-1]), np.sin(heading[:-1])
        odometry[1:, 0] = np.cumsum(cos * ahead - sin * left)
        odometry[1:, 1] = np.cumsum(sin * ahead + cos * left)
        return odometry


@dataclass(frozen=True, slots=True)
class Laser:
    """A range finder that looks half around, as CARMEN logs have it.

    mount: x, y, θ of the laser in the robot's frame, metres and radians.
    """

    beams: int = 181  # from −90° on the right to +90° on the left, both included
    range_max: float = 10.0  # m
    sigma: float = 0.02  # m, of each range
    missing: float = 0.02  # chance of a beam not to return
    mount: tuple[float, float, float] = (0.15, 0.05, 0.0)

    def __post_init__(self) -> None:
        if self.beams not in (181, 361):
            raise ConfigError(f"a laser has 181 or 361 beams, got {self.beams}")
        if not (self.range_max > 0.0 and self.sigma >= 0.0 and 0.0 <= self.missing <= 1.0):
            raise ConfigError(f"range_max must be > 0, sigma ≥ 0, missing from 0 to 1: {self}")

    @property
    def angles(self) -> NDArray[np.float64]:
        """(B,) radians in the laser's frame, 0 ahead, positive to the left."""
        return np.linspace(-np.pi / 2, np.pi / 2, self.beams)

    def measure(
        self, grid: OccupancyGrid, robot: Poses, rng: np.random.Generator
    ) -> NDArray[np.float64]:
        """(N, B) metres measured by a robot at the poses (N, 3); inf where nothing returns."""
        exact = ranges(grid, compose(robot, self.mount), self.angles, self.range_max)
        measured = exact + self.sigma * rng.standard_normal(exact.shape)
        lost = (rng.random(exact.shape) < self.missing) | (measured >= self.range_max)
        return np.where(lost, np.inf, np.maximum(measured, 0.0))
