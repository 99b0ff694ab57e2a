"""A floor, four paths through it and a robot with a ring of sonars: the world of E15, E16 and E17
[Yee §5, Fig. 1].
"""

from collections.abc import Mapping
from functools import cache
from itertools import pairwise

import numpy as np

from mcloc.errors import ConfigError
from mcloc.events import Scan
from mcloc.experiments.places import Drive
from mcloc.geometry import Poses
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.registry import Value
from mcloc.simulation import Laser, Roadmap, Wheels, follow
from mcloc.simulation.floor import WALL, Box, Floor
from mcloc.simulation.robot import STEP
from mcloc.trajectory import Trajectory

WIDTH, DEPTH, CELL = 12.0, 9.0, 0.05  # m
SPEED = 0.5  # m/s
EVERY = 6  # poses of a drive from measurement to measurement: 0.3 s, 0.15 m
SONARS = 16
REACH, CONE, NOISE = 3.0, float(np.radians(20.0)), 0.05  # m, rad, m/m  [Yee §2]
MISSED, UNEXPECTED = 0.05, 0.05  # shares of the readings

WORLD = f"""
The paper says of its simulation that it is indoors, and that its data were generated from its own
models; the picture of the environment is lost. Chosen here, once:

- A floor of 12 m × 9 m: five furnished rooms, a corridor and a hall with a pillar, none like
  another. Nearly everywhere some wall is within the 3 m that the sonars reach. Cells are 5 cm.
- Four paths of 16 to 19 m, which together come into all rooms. The robot drives at 0.5 m/s, and
  measures each 0.3 s: that is 0.15 m, or up to 0.3 rad. These are the steps of time.
- *Kidnapped* robots drive one path up to its middle, and are carried to the start of another one,
  5 m away or more, which they drive up to its middle. Their wheels tell nothing of it.
- A ring of {SONARS} sonars in the middle of the robot, one each 22.5°. The paper has "range-finding
  sensors placed evenly", with 3 m, a diffraction angle of 20° and a noise of 5 %: each measures the
  nearest wall within ± 10°, with a deviation of 5 % of the range.
- The paper's sensor model has misses and unknown obstacles, without their shares:
  {100 * MISSED:g} % of the readings are none, and {100 * UNEXPECTED:g} % are anything up to 3 m.
  Filters are told so.
- Wheels err at random, about as much in a step as mcloc's default motion model expects.
- The filters' sensor model is the paper's: readings are multiplied as if they were independent, and
  each measurement counts in full. Ranges are looked up; for the cells of that table 5 cm are added
  to the deviation, in quadrature.
"""

ROOMS = (  # left, bottom, right, top
    Box(WALL, WALL, 4.2, 3.75),
    Box(4.35, WALL, 7.4, 3.75),
    Box(7.55, WALL, WIDTH - WALL, 2.75),
    Box(WALL, 5.4, 2.9, DEPTH - WALL),
    Box(3.05, 5.4, 7.4, DEPTH - WALL),
    Box(WALL, 3.9, 7.55, 5.25),  # the corridor
    Box(7.55, 2.9, WIDTH - WALL, DEPTH - WALL),  # the hall
)
DOORS = (
    Box(2.7, 3.75, 3.7, 3.9),
    Box(4.7, 3.75, 5.6, 3.9),
    Box(10.4, 2.75, 11.4, 2.9),
    Box(1.1, 5.25, 2.1, 5.4),
    Box(5.9, 5.25, 6.9, 5.4),
    Box(7.4, 6.9, 7.55, 7.9),
)
FURNITURE = (
    Box(WALL, 0.6, 0.65, 2.2),
    Box(1.7, 1.3, 2.9, 2.0),
    Box(6.4, WALL, 7.4, 2.05),
    Box(4.35, WALL, 5.0, 1.2),
    Box(7.55, 0.9, 8.0, 2.3),
    Box(9.2, WALL, 11.0, 0.5),
    Box(WALL, 7.9, 1.5, DEPTH - WALL),
    Box(2.5, 6.4, 2.9, 7.3),
    Box(4.4, 6.8, 5.9, 7.6),
    Box(3.05, 5.4, 3.5, 6.5),
    Box(11.1, 5.3, WIDTH - WALL, 7.1),
    Box(8.2, 8.35, 9.8, DEPTH - WALL),
    Box(9.0, 3.9, 9.9, 4.4),
)
PILLAR = 9.3, 6.5, 0.25  # x, y, radius

PATHS = (  # points to drive by
    ((1.0, 7.2), (1.6, 4.6), (8.3, 4.8), (10.5, 5.6), (10.9, 2.0), (8.7, 1.4)),
    ((1.2, 2.7), (2.3, 0.8), (3.6, 1.6), (3.2, 4.5), (6.4, 4.8), (6.6, 8.2), (3.8, 8.0)),
    ((5.6, 2.6), (5.1, 4.4), (8.3, 5.4), (10.4, 7.9), (8.4, 7.5), (6.6, 6.2), (4.0, 7.0)),
    ((11.3, 1.2), (10.9, 3.5), (8.3, 5.6), (8.4, 4.0), (3.3, 4.6), (3.4, 1.0), (1.2, 2.7)),
)
GOES_ON = (1, 3, 0, 0)
"""The path to whose start the robot is carried from the middle of each."""

SONAR = Laser(
    beams=SONARS,
    fov=2.0 * np.pi * (SONARS - 1) / SONARS,
    range_max=REACH,
    sigma=0.0,
    sigma_relative=NOISE,
    cone=CONE,
    missing=MISSED,
    mount=(0.0, 0.0, 0.0),
    source="sonars",
)
WHEELS = Wheels(scale=0.0, drift=0.0, sigma_distance=0.05, sigma_turn=0.08, sigma_drift=0.045)
SENSOR: Mapping[str, Value] = {
    "ranges": "table",
    "cone": CONE,
    "sigma_hit": CELL,
    "sigma_relative": NOISE,
    "z_hit": 1.0 - MISSED - UNEXPECTED,
    "z_miss": MISSED,
    "z_rand": UNEXPECTED,
    "effective_beams": float(SONARS),
}
"""Of the filters' sensor model, `beam-yee`."""


@cache
def yee_world() -> OccupancyGrid:
    """The floor; its lower left corner is the map frame's origin."""
    floor = Floor(WIDTH, DEPTH, CELL)
    for free in (*ROOMS, *DOORS):
        floor.fill(free, FREE)
    for piece in FURNITURE:
        floor.fill(piece, OCCUPIED)
    floor.column(*PILLAR)
    return floor.grid("yee_world")


@cache
def path(k: int) -> Poses:
    """(T, 3): where the robot truly is at each measurement on path k, 0 … 3."""
    if not 0 <= k < len(PATHS):
        raise ConfigError(f"there are the paths 0 … {len(PATHS) - 1}, not {k}")
    roadmap = Roadmap(yee_world())
    places = [roadmap.nearest(np.array(point)) for point in PATHS[k]]
    ways = [roadmap.way(a, b)[1:] for a, b in pairwise(places)]
    route = roadmap.points[[places[0], *np.concatenate(ways)]]
    return follow(route, SPEED).poses[::EVERY]


def driven(k: int, seed: int) -> Drive:
    """Path k, with noise of its own for each seed ≥ 0."""
    return _measured(path(k), k, seed)


def kidnapped(k: int, seed: int) -> Drive:
    """Path k up to its middle, and the first half of another one, see GOES_ON."""
    before, after = (half[: len(half) // 2] for half in (path(k), path(GOES_ON[k])))
    return _measured(np.concatenate([before, after]), k, seed, (len(before),))


def _measured(poses: Poses, k: int, seed: int, carried: tuple[int, ...] = ()) -> Drive:
    """What a robot reports at its true poses; `carried`: those to which it was carried."""
    for_wheels, for_sonars = map(np.random.default_rng, np.random.SeedSequence((seed, k)).spawn(2))
    odometry = WHEELS.measure(poses, for_wheels, carried)
    ranges = SONAR.measure(yee_world(), poses, for_sonars)
    unexpected = for_sonars.random(ranges.shape) < UNEXPECTED
    ranges = np.where(unexpected, REACH * for_sonars.random(ranges.shape), ranges)
    stamps = STEP * EVERY * np.arange(len(poses), dtype=np.float64)
    events = tuple(
        Scan(float(t), scan, SONAR.angles, REACH, np.zeros(3), pose, source=SONAR.source)
        for t, scan, pose in zip(stamps, ranges, odometry, strict=True)
    )
    return Drive(yee_world(), events, Trajectory(stamps, poses))
