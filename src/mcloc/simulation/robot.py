"""How a robot drives along a route: it steers for a point a little ahead on it."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.errors import ConfigError
from mcloc.geometry import wrap
from mcloc.trajectory import Trajectory

STEP = 0.05  # s between two poses of a drive
LOOKAHEAD = 0.4  # m from the robot to the point of the route that it steers for
TURN_GAIN = 2.0  # rad/s for each radian between its heading and that point
TURN_MAX = 1.0  # rad/s
_LOOKED_AT = 32  # points at a time: the one that is not near is close


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
    for first in range(start, len(points), _LOOKED_AT):
        off = points[first : first + _LOOKED_AT] - (x, y)
        far = np.hypot(off[:, 0], off[:, 1]) > LOOKAHEAD
        if far.any():
            return first + int(far.argmax())
    return len(points) - 1
