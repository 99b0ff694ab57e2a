"""Worlds, drives and logs whose truth is known."""

from mcloc.simulation.drive import SimulatedDrive, office_drive, simulate
from mcloc.simulation.ranges import ranges
from mcloc.simulation.recording import write_drive
from mcloc.simulation.robot import Laser, Wheels, follow
from mcloc.simulation.route import tour
from mcloc.simulation.world import office_world

__all__ = [
    "Laser",
    "SimulatedDrive",
    "Wheels",
    "follow",
    "office_drive",
    "office_world",
    "ranges",
    "simulate",
    "tour",
    "write_drive",
]
