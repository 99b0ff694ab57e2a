"""From end to end in a world, with a robot, wheels and a laser that are not of our making: IR-SIM.

Its wheels execute other velocities than they are told, by its own noise; odometry is what they were
told. Its laser casts rays against the shapes of its world, of which the map is a raster.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from scipy import ndimage

from mcloc.events import Event, Odometry, Scan
from mcloc.geometry import compose, wrap
from mcloc.localizer import Estimate, Localizer
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.simulation import ranges

irsim = pytest.importorskip("irsim", reason="IR-SIM is not installed")

STEP = 0.1  # s
SPEED, TURN_MAX = 0.5, 0.8  # m/s, rad/s
ALPHA = (0.03, 0.0, 0.0, 0.03)  # variance of a velocity over its square, each step
SIGMA = 0.03  # m, of a range
RESOLUTION = 0.05  # m
MOUNT = (0.1, 0.0, 0.0)
WIDTH, HEIGHT = 12.0, 8.0  # m
UPDATE = 0.2  # m between two updates of the filter
WHEELS = float(np.sqrt(ALPHA[0] * UPDATE * SPEED * STEP))  # m, their deviation over that
FOUND_WITHIN = 5.0  # s
ROUTE = [(2, 2), (10, 1.5), (10.5, 6.5), (7, 6.7), (6.6, 4), (3, 4), (2, 6.5), (1.2, 2)]

WORLD = f"""
world: {{height: {HEIGHT}, width: {WIDTH}, step_time: {STEP}, control_mode: auto}}
robot:
  - kinematics: {{name: diff, noise: true, alpha: {list(ALPHA)}}}
    shape: {{name: circle, radius: 0.2}}
    state: [2.0, 2.0, 0.0]
    vel_max: [1.0, 2.0]
    vel_min: [-1.0, -2.0]
    sensors:
      - {{name: lidar2d, range_min: 0.05, range_max: 8.0, angle_range: {np.pi}, number: 181,
         noise: true, std: {SIGMA}, offset: {list(MOUNT)}}}
obstacle:
  - {{shape: {{name: rectangle, length: 12.0, width: 0.2}}, state: [6.0, 0.1, 0]}}
  - {{shape: {{name: rectangle, length: 12.0, width: 0.2}}, state: [6.0, 7.9, 0]}}
  - {{shape: {{name: rectangle, length: 0.2, width: 8.0}}, state: [0.1, 4.0, 0]}}
  - {{shape: {{name: rectangle, length: 0.2, width: 8.0}}, state: [11.9, 4.0, 0]}}
  - {{shape: {{name: rectangle, length: 0.2, width: 2.6}}, state: [5.0, 6.5, 0]}}
  - {{shape: {{name: rectangle, length: 3.0, width: 0.2}}, state: [6.4, 2.7, 0]}}
  - {{shape: {{name: rectangle, length: 0.9, width: 0.6}}, state: [8.7, 4.2, 0.5]}}
  - {{shape: {{name: circle, radius: 0.4}}, state: [3.2, 2.9, 0]}}
"""


@dataclass(frozen=True)
class Drive:
    """events; t (N,) of the scans and truth (N, 3), the robot's pose at each; grid: the map."""

    grid: OccupancyGrid
    events: list[Event]
    t: np.ndarray
    truth: np.ndarray


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Drive]:
    path = tmp_path_factory.mktemp("ir-sim") / "world.yaml"
    path.write_text(WORLD)
    world = irsim.make(str(path), display=False, log_level="ERROR", seed=4)
    try:
        yield recorded(world)
    finally:
        world.end()


def recorded(world: irsim.EnvBase) -> Drive:
    """Steer along the route by the true pose; note what was commanded, and what the laser saw."""
    grid = rasterized(world)
    angles = np.linspace(-np.pi / 2, np.pi / 2, 181)
    believed = np.zeros(3)
    events: list[Event] = [Odometry(0.0, believed)]
    truth = []
    goals = [np.array(goal, dtype=float) for goal in ROUTE[1:]]
    t = 0.0
    while goals:
        x, y, theta = world.robot.state[:3, 0]
        if np.hypot(*(goals[0] - (x, y))) < 0.3:
            goals.pop(0)
            continue
        off = float(wrap(np.arctan2(goals[0][1] - y, goals[0][0] - x) - theta))
        turn = float(np.clip(2.0 * off, -TURN_MAX, TURN_MAX))
        ahead = SPEED * max(0.0, np.cos(off))
        world.step(np.array([[ahead], [turn]]))
        t += STEP
        believed = compose(believed, [ahead * STEP, 0.0, turn * STEP])
        scan = world.get_lidar_scan()
        ranges = np.where(scan["valid"], scan["ranges"], np.inf)
        events.append(Odometry(t, believed))
        events.append(Scan(t, ranges, angles, scan["range_max"], np.array(MOUNT)))
        truth.append(world.robot.state[:3, 0].copy())
        assert not world.robot.collision
    stamps = np.array([event.t for event in events if isinstance(event, Scan)])
    return Drive(grid, events, stamps, np.array(truth))


def rasterized(world: irsim.EnvBase) -> OccupancyGrid:
    """As a mapper sees it: cells whose centres lie in a shape, but unknown what is behind them."""
    import shapely

    shape = (round(HEIGHT / RESOLUTION), round(WIDTH / RESOLUTION))
    row, column = np.indices(shape)
    x, y = (column + 0.5) * RESOLUTION, (row + 0.5) * RESOLUTION
    solid = np.any([shapely.contains_xy(o.geometry, x, y) for o in world.obstacle_list], axis=0)
    inside = ndimage.binary_erosion(solid, np.ones((3, 3)), border_value=1)
    cells = np.select([inside, solid], [UNKNOWN, OCCUPIED], FREE).astype(np.int8)
    return OccupancyGrid(cells, RESOLUTION, np.zeros(3))


def errors(drive: Drive, estimates: list[Estimate]) -> tuple[np.ndarray, np.ndarray]:
    """Position (m) and heading (rad) off the truth at each estimate."""
    truth = drive.truth[np.searchsorted(drive.t, [e.t for e in estimates])]
    off = np.array([e.pose for e in estimates]) - truth
    return np.hypot(off[:, 0], off[:, 1]), np.abs(wrap(off[:, 2]))


def test_our_ray_caster_agrees_with_another_one(drive: Drive) -> None:
    scans = [event for event in drive.events if isinstance(event, Scan)]
    ours = ranges(drive.grid, compose(drive.truth, MOUNT), scans[0].angles, scans[0].range_max)
    theirs = np.array([scan.ranges for scan in scans])
    both = np.isfinite(ours) & np.isfinite(theirs)
    assert both.mean() > 0.9 * np.isfinite(theirs).mean()
    off = theirs[both] - ours[both]
    assert abs(np.median(off)) < RESOLUTION / 10  # the walls lie along borders of cells
    # Half of all normal errors are below 0.6745 σ; the raster of what is turned or round adds some.
    assert 0.67 * SIGMA < np.median(np.abs(off)) < 0.75 * SIGMA


def test_wheels_alone_lose_the_way(drive: Drive) -> None:
    last = next(event for event in reversed(drive.events) if isinstance(event, Odometry))
    believed = compose(np.array([2.0, 2.0, 0.0]), last.pose)
    assert np.hypot(*(believed - drive.truth[-1])[:2]) > 0.3


@pytest.mark.parametrize("initial", [None, (2.0, 2.0, 0.0)], ids=["from nothing", "tracking"])
def test_the_robot_is_found_and_followed(
    drive: Drive, initial: tuple[float, float, float] | None
) -> None:
    estimates = list(Localizer(drive.grid, seed=1, initial=initial).run(drive.events))
    assert len(estimates) == len(drive.t)
    position, heading = errors(drive, estimates)
    settled = drive.t > (0.0 if initial else FOUND_WITHIN)
    # A map knows no place better than a cell; from one update to the next the wheels err as well.
    assert np.median(position[settled]) < RESOLUTION
    assert np.percentile(position[settled], 95.0) < RESOLUTION + 3.0 * WHEELS
    assert position[settled].max() < RESOLUTION + 6.0 * WHEELS
    assert (
        np.median(heading[settled]) < RESOLUTION / 2.0
    )  # that of a wall 2 m away, seen a cell off
