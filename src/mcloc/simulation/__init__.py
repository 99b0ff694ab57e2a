"""Worlds, drives and logs whose truth is known."""

from mcloc.simulation.drive import Scenario, SimulatedDrive, evenly, office_drive, simulate
from mcloc.simulation.laser import Laser
from mcloc.simulation.museum import museum_world
from mcloc.simulation.office import office_world
from mcloc.simulation.ranges import ranges
from mcloc.simulation.recording import write_drive
from mcloc.simulation.robot import follow
from mcloc.simulation.route import Roadmap, tour
from mcloc.simulation.teleports import Teleported, teleported
from mcloc.simulation.wheels import Wheels
from mcloc.simulation.world import WORLDS

__all__ = [
    "WORLDS",
    "Laser",
    "Roadmap",
    "Scenario",
    "SimulatedDrive",
    "Teleported",
    "Wheels",
    "evenly",
    "follow",
    "museum_world",
    "office_drive",
    "office_world",
    "ranges",
    "simulate",
    "teleported",
    "tour",
    "write_drive",
]
