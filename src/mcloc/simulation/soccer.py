"""The field of the RoboCup four-legged league of about 2005, a robot that walks on it, and what its
camera sees of the landmarks: the world of Estivill-Castro, McKenzie: Hierarchical Monte-Carlo
localisation.

As teams of that year describe it, the playing area is 5.4 m long, four beacons stand at its edge,
1.35 m from the halfway line, and beacons and goals are told apart by their colours. Assumed are a
playing area 3.6 m wide, beacons 0.1 m beside it, and that of a goal its centre on the goal line is
seen: according to the paper its edges are hard to recognize.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.errors import ConfigError
from mcloc.events import Sightings
from mcloc.geometry import Poses, wrap
from mcloc.registry import Configurable, param

SPEED = 0.3  # m/s
TURN = 1.5  # rad/s
MARGIN = 0.2  # m that the robot keeps from the lines


@dataclass(frozen=True, eq=False)
class SoccerField:
    """A field around the origin of the map frame, x towards the opponents' goal, y to the left.

    half_length, half_width: m, along x and y. names, places: of the landmarks; places (L, 2), m.
    Raises ConfigError for a field without room to walk, and for landmarks that cannot be.
    """

    half_length: float
    half_width: float
    names: tuple[str, ...]
    places: NDArray[np.float64]

    def __post_init__(self) -> None:
        if not all(MARGIN < half < math.inf for half in (self.half_length, self.half_width)):
            raise ConfigError(
                f"half of a field must be more than the {MARGIN} m that robots keep from its "
                f"lines, got {self.half_length} m x {self.half_width} m"
            )
        if self.places.shape != (len(self.names), 2) or not np.isfinite(self.places).all():
            raise ConfigError(
                f"landmarks have a name and a finite x, y each, got {len(self.names)} names and "
                f"a table of shape {self.places.shape}"
            )


FOUR_LEGGED = SoccerField(
    2.7,
    1.8,
    (
        "opponents' goal",
        "own goal",
        "beacon front left",
        "beacon front right",
        "beacon rear left",
        "beacon rear right",
    ),
    np.array([[2.7, 0.0], [-2.7, 0.0], [1.35, 1.9], [1.35, -1.9], [-1.35, 1.9], [-1.35, -1.9]]),
)


@dataclass(frozen=True)
class HeadCamera(Configurable):
    """A camera in a head that pans: from one look to the next it sweeps once from side to side, as
    Sony's ERS-7 can, and what it sees on the way counts as seen at once.

    A range is estimated from a landmark's size in the image, so its deviation grows with the
    distance. An estimate that is not in (0, range_max] is dropped, and NaN.
    """

    fov: float = param(math.radians(57.0), "rad", "angle across the image", above=0, high=math.pi)
    pan: float = param(
        math.radians(90.0), "rad", "how far the head turns to each side", low=0, high=math.pi
    )
    range_max: float = param(8.0, "m", "longest range that is reported", above=0, high=1e5)
    sigma_range: float = param(0.05, "m", "deviation of a range to 0 m", low=0, high=100)
    sigma_relative: float = param(0.1, "m/m", "deviation per distance, in quadrature", low=0)
    sigma_bearing: float = param(0.05, "rad", "deviation of a bearing", low=0, high=10)
    p_outlier: float = param(
        0.01, "", "chance that a range, or a bearing, is anything", low=0, high=1
    )

    @property
    def view(self) -> float:
        """Radians to each side of the heading in which landmarks are seen."""
        return self.pan + self.fov / 2.0


AIBO = HeadCamera()


def drive(seed: int, steps: int, interval: float, field: SoccerField = FOUR_LEGGED) -> Poses:
    """(steps + 1, 3): the poses of a robot that walks from one random place to the next, one every
    `interval` seconds.

    It starts anywhere, in any direction, stays 0.2 m within the lines, and walks straight at up to
    0.3 m/s, as fast as for each place it likes to. It turns to where it goes at up to 1.5 rad/s
    and is the slower the less it faces it: four legs can walk sideways, but not well. Raises
    ConfigError for a seed or steps < 0, or an interval that is not > 0.
    """
    if seed < 0 or steps < 0:
        raise ConfigError(f"seed and steps must be whole numbers >= 0, got {seed} and {steps}")
    if not 0.0 < interval < math.inf:
        raise ConfigError(f"interval must be > 0 s, got {interval}")
    rng = np.random.default_rng(seed)
    half = np.array([field.half_length, field.half_width]) - MARGIN
    place, heading = rng.uniform(-half, half), np.pi * (1.0 - 2.0 * rng.random())
    goal, speed = place, 0.0
    poses = [(*place, heading)]
    for _ in range(steps):
        if np.array_equal(place, goal):
            goal, speed = rng.uniform(-half, half), SPEED * rng.uniform(0.5, 1.0)
        way = goal - place
        off = float(wrap(math.atan2(way[1], way[0]) - heading))
        left, stride = math.hypot(*way), interval * speed * max(0.2, math.cos(off))
        place = goal if stride >= left else place + stride / left * way
        heading = float(wrap(heading + np.clip(off, -TURN * interval, TURN * interval)))
        poses.append((*place, heading))
    return np.array(poses)


def seen(
    pose: ArrayLike,
    rng: np.random.Generator,
    camera: HeadCamera = AIBO,
    field: SoccerField = FOUR_LEGGED,
) -> Sightings:
    """The landmarks in view of a robot at a pose (3,), map frame, each with range and bearing.

    The same random numbers are drawn whatever is in view. Raises ConfigError for a pose that is not
    finite x, y, θ.
    """
    x = np.asarray(pose, dtype=np.float64)
    if x.shape != (3,) or not np.isfinite(x).all():
        raise ConfigError(f"a pose must be finite x, y, θ, got {x.tolist()}")
    n = len(field.places)
    for_range, for_bearing = rng.standard_normal((2, n))
    range_is_wrong, bearing_is_wrong = rng.random((2, n)) < camera.p_outlier
    any_range, any_bearing = rng.random((2, n))
    dx, dy = (field.places - x[:2]).T
    d, bearing = np.hypot(dx, dy), wrap(np.arctan2(dy, dx) - x[2])
    r = d + np.hypot(camera.sigma_range, camera.sigma_relative * d) * for_range
    r = np.where(range_is_wrong, camera.range_max * (1.0 - any_range), r)
    r[(r <= 0.0) | (r > camera.range_max)] = np.nan
    b = np.where(bearing_is_wrong, 2.0 * np.pi * any_bearing, bearing)
    b += np.where(bearing_is_wrong, 0.0, camera.sigma_bearing * for_bearing)
    shown = np.flatnonzero(np.abs(bearing) <= camera.view)
    return Sightings(0.0, shown, r[shown], wrap(b[shown]))
