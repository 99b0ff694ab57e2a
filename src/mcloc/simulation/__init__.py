"""Worlds, drives and logs whose truth is known."""

from mcloc.simulation.aids import write_beacons_heard, write_ceiling_seen, write_landmarks_seen
from mcloc.simulation.ceiling import CeilingPlan, ceiling_mosaic
from mcloc.simulation.ceiling_camera import CeilingCamera
from mcloc.simulation.ceiling_drive import CeilingDrive, CeilingTour, ceiling_drive
from mcloc.simulation.ceiling_recording import write_ceiling_drive
from mcloc.simulation.drive import Scenario, SimulatedDrive, evenly, office_drive, simulate
from mcloc.simulation.laser import Laser
from mcloc.simulation.lookout import Lookout
from mcloc.simulation.museum import museum_world
from mcloc.simulation.office import office_world
from mcloc.simulation.radio import Radio
from mcloc.simulation.ranges import ranges
from mcloc.simulation.recording import write_drive
from mcloc.simulation.robot import follow
from mcloc.simulation.route import Roadmap, tour
from mcloc.simulation.sonar import SonarRing
from mcloc.simulation.team_drive import Spotter, TeamDrive, simulate_team
from mcloc.simulation.teleports import Teleported, teleported
from mcloc.simulation.wheels import Wheels
from mcloc.simulation.world import WORLDS

__all__ = [
    "WORLDS",
    "CeilingCamera",
    "CeilingDrive",
    "CeilingPlan",
    "CeilingTour",
    "Laser",
    "Lookout",
    "Radio",
    "Roadmap",
    "Scenario",
    "SimulatedDrive",
    "SonarRing",
    "Spotter",
    "TeamDrive",
    "Teleported",
    "Wheels",
    "ceiling_drive",
    "ceiling_mosaic",
    "evenly",
    "follow",
    "museum_world",
    "office_drive",
    "office_world",
    "ranges",
    "simulate",
    "simulate_team",
    "teleported",
    "tour",
    "write_beacons_heard",
    "write_ceiling_drive",
    "write_ceiling_seen",
    "write_drive",
    "write_landmarks_seen",
]
