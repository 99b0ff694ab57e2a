"""A simulated drive: what the robot reported, and where it truly was."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mcloc.events import Event, Odometry, Scan
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation.robot import Laser, Wheels, follow
from mcloc.simulation.route import tour
from mcloc.simulation.world import office_world
from mcloc.trajectory import Trajectory

ODOMETRY_EVERY = 2  # poses of the drive: 10 Hz
SCAN_EVERY = 4  # 5 Hz, each between two odometry readings


@dataclass(frozen=True, eq=False)
class SimulatedDrive:
    """grid: the map. events: in the order of time, t in seconds from 0. truth: in the map frame."""

    grid: OccupancyGrid
    events: tuple[Event, ...]
    truth: Trajectory


def simulate(
    grid: OccupancyGrid,
    route: ArrayLike,
    seed: int,
    *,
    speed: float = 0.5,
    wheels: Wheels | None = None,
    laser: Laser | None = None,
) -> SimulatedDrive:
    """Drive along the route and record it: odometry at 10 Hz, scans at 5 Hz.

    route: (K, 2) metres in the map frame, see `follow`. speed: m/s.
    """
    wheels, laser = wheels or Wheels(), laser or Laser()
    rng = np.random.default_rng(seed)
    truth = follow(route, speed)
    odometry = wheels.measure(truth.poses, rng)
    scanned = slice(1, None, SCAN_EVERY)
    ranges = laser.measure(grid, truth.poses[scanned], rng)

    events: list[Event] = [
        Odometry(t, pose)
        for t, pose in zip(truth.t[::ODOMETRY_EVERY], odometry[::ODOMETRY_EVERY], strict=True)
    ]
    events += [
        Scan(t, scan, laser.angles, laser.range_max, np.array(laser.mount), pose)
        for t, scan, pose in zip(truth.t[scanned], ranges, odometry[scanned], strict=True)
    ]
    return SimulatedDrive(grid, tuple(sorted(events, key=lambda event: event.t)), truth)


def office_drive(seed: int = 0, length: float = 80.0) -> SimulatedDrive:
    """A drive of about `length` metres from room to room of `office_world(seed)`."""
    world = office_world(seed)
    return simulate(world, tour(world, length, seed), seed)
