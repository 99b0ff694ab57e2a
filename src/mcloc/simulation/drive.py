"""A simulated drive: what the robot reported, and where it truly was."""

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.events import Event, Odometry, Scan
from mcloc.maps.occupancy import FREE, OccupancyGrid
from mcloc.registry import Configurable, param
from mcloc.simulation.glass import panes
from mcloc.simulation.laser import Laser
from mcloc.simulation.office import office_world
from mcloc.simulation.people import Crowd
from mcloc.simulation.robot import STEP, follow
from mcloc.simulation.route import Roadmap, travelled
from mcloc.simulation.wheels import Wheels
from mcloc.trajectory import Trajectory

SPEED = 0.5  # m/s
ODOMETRY_EVERY = 2  # poses of the drive: 10 Hz
SCAN_EVERY = 4  # 5 Hz, each between two odometry readings
LEAST_LEG = 1.0  # m that a robot drives after a kidnapping
PLACES = 8  # random ones: a kidnapping leads to that which is farthest away


@dataclass(frozen=True)
class Scenario(Configurable):
    """What happens on a drive, and with what it is recorded.

    kidnap_at: s from the start of the drive, > 0, in increasing order. wheels, lasers: of the
    robot; each laser has a name of its own.
    """

    length: float = param(80.0, "m", "of the drive", low=1.0, high=1e5)
    people: int = param(0, "", "people who walk about", low=0, high=1000)
    visitors: float = param(0.5, "", "share of them who gather at the robot", low=0.0, high=1.0)
    glass: float = param(0.0, "", "share of the walls that beams may pass", low=0.0, high=1.0)
    glass_mapped: bool = param(True, "", "whether glass is in the map as a wall")
    kidnap_at: tuple[float, ...] = ()
    wheels: Wheels = field(default_factory=Wheels)
    lasers: tuple[Laser, ...] = (Laser(),)

    def __post_init__(self) -> None:
        super().__post_init__()
        times = (0.0, *self.kidnap_at)
        if not (all(a < b for a, b in pairwise(times)) and np.isfinite(times).all()):
            raise ConfigError(f"kidnappings must be at increasing times > 0 s: {self.kidnap_at}")
        if len({laser.source for laser in self.lasers}) < len(self.lasers) or not self.lasers:
            raise ConfigError("a robot has at least one laser, and each has a name of its own")


@dataclass(frozen=True, eq=False)
class SimulatedDrive:
    """What a drive left behind.

    grid: the map. events: in the order of time, t in seconds from 0. truth: in the map frame.
    kidnappings: the stamps of the first poses in a new place.
    """

    grid: OccupancyGrid
    events: tuple[Event, ...]
    truth: Trajectory
    kidnappings: tuple[float, ...] = ()

    @property
    def distance(self) -> float:
        """Metres that the robot drove; not those that it was carried."""
        steps = np.diff(self.truth.poses[:, :2], axis=0)
        carried = np.isin(self.truth.t[1:], self.kidnappings)
        return float(np.hypot(*steps[~carried].T).sum())


def simulate(world: OccupancyGrid, seed: int, scenario: Scenario | None = None) -> SimulatedDrive:
    """Drive through a world and record it: odometry at 10 Hz, scans of each laser at 5 Hz.

    One seed, the same drive; route, wheels, lasers, people and glass draw apart from each other.
    Raises MapError for a world without room to drive, ConfigError for a seed < 0 or a kidnapping
    after the end of the drive.
    """
    if seed < 0:
        raise ConfigError(f"seed must be a whole number >= 0, got {seed}")
    scenario = scenario or Scenario()
    for_route, for_wheels, for_lasers, for_people, for_glass = (
        np.random.default_rng(source) for source in np.random.SeedSequence(seed).spawn(5)
    )
    roadmap = Roadmap(world)
    truth, kidnapped = _drive(roadmap, scenario, for_route)
    odometry = scenario.wheels.measure(truth.poses, for_wheels, kidnapped)
    events: list[Event] = [
        Odometry(t, pose)
        for t, pose in zip(truth.t[::ODOMETRY_EVERY], odometry[::ODOMETRY_EVERY], strict=True)
    ]

    glass = panes(world, scenario.glass, for_glass) if scenario.glass else None
    crowd = Crowd(scenario.people, roadmap, truth, for_people, visitors=scenario.visitors)
    for k, laser in enumerate(scenario.lasers):
        scanned = slice(1 + ODOMETRY_EVERY * (k % 2), None, SCAN_EVERY)  # two take turns
        t, poses = truth.t[scanned], truth.poses[scanned]
        ranges = laser.measure(world, poses, for_lasers, glass=glass, people=crowd.at(t, poses))
        events += [
            Scan(
                stamp,
                scan,
                laser.angles,
                laser.range_max,
                np.array(laser.mount),
                pose,
                range_min=laser.range_min,
                source=laser.source,
            )
            for stamp, scan, pose in zip(t, ranges, odometry[scanned], strict=True)
        ]
    events.sort(key=lambda event: event.t)
    grid = world if glass is None or scenario.glass_mapped else _without(world, glass)
    return SimulatedDrive(grid, tuple(events), truth, tuple(truth.t[kidnapped].tolist()))


def evenly(n: int, length: float) -> tuple[float, ...]:
    """Times (s) of n kidnappings that cut a drive of `length` metres into about equal parts."""
    return tuple(length / SPEED * k / (n + 1) for k in range(1, n + 1))


def office_drive(seed: int = 0, length: float = 80.0) -> SimulatedDrive:
    """A drive of about `length` metres from room to room of `office_world(seed)`."""
    return simulate(office_world(seed), seed, Scenario(length=length))


def _drive(
    roadmap: Roadmap, scenario: Scenario, rng: np.random.Generator
) -> tuple[Trajectory, list[int]]:
    """Where the robot goes, a pose each 0.05 s, and the indices at which it is kidnapped."""
    poses = np.empty((0, 3))
    kidnapped: list[int] = []
    start, driven = roadmap.random(rng), 0.0
    for until in (*scenario.kidnap_at, np.inf):
        route = roadmap.tour(max(scenario.length - driven, LEAST_LEG), rng, start)
        leg = follow(route, SPEED).poses
        end = STEP * (len(poses) + len(leg))
        if end <= until < np.inf:
            raise ConfigError(
                f"no kidnapping at {until:g} s: the drive of {scenario.length:g} m "
                f"ends at {end:g} s"
            )
        leg = leg[: int(np.ceil(min(until, end) / STEP)) - len(poses)]
        poses = np.concatenate([poses, leg])
        driven += travelled(leg[:, :2])[-1]
        if until < np.inf:
            kidnapped.append(len(poses))
            elsewhere = [roadmap.random(rng) for _ in range(PLACES)]
            away = np.hypot(*(roadmap.points[elsewhere] - poses[-1, :2]).T)
            start = elsewhere[int(away.argmax())]
    return Trajectory(STEP * np.arange(len(poses), dtype=np.float64), poses), kidnapped


def _without(world: OccupancyGrid, glass: NDArray[np.bool_]) -> OccupancyGrid:
    """The map by somebody who saw no glass."""
    return replace(world, cells=np.where(glass, FREE, world.cells).astype(np.int8))
