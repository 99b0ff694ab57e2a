"""Monte Carlo localization of mobile robots in Python.

The public names; each is imported when it is first used, so that `import mcloc` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mcloc.config import RunConfig
    from mcloc.errors import (
        ConfigError,
        FilterError,
        LogError,
        MapError,
        McLocError,
        StateError,
        TruthError,
    )
    from mcloc.estimate import Hypothesis
    from mcloc.evaluation import Accuracy, evaluate
    from mcloc.events import BeaconRanges, Detection, Image, Odometry, Scan, Sightings
    from mcloc.filters.catalog import Composition
    from mcloc.io.bag_map import read_map
    from mcloc.io.bag_truth import read_truth
    from mcloc.io.log import read_log
    from mcloc.io.tum import read_trajectory, write_tum
    from mcloc.localizer import Estimate, Localizer, UpdatePolicy
    from mcloc.localizer.state import restore, save
    from mcloc.maps.beacons import Beacons
    from mcloc.maps.landmarks import Landmarks
    from mcloc.maps.mosaic import Mosaic
    from mcloc.maps.occupancy import OccupancyGrid
    from mcloc.maps.teammates import Teammates
    from mcloc.report import Run
    from mcloc.team.team import Team
    from mcloc.trajectory import Trajectory

__version__ = "0.1.0"

__all__ = [
    "Accuracy",
    "BeaconRanges",
    "Beacons",
    "Composition",
    "ConfigError",
    "Detection",
    "Estimate",
    "FilterError",
    "Hypothesis",
    "Image",
    "Landmarks",
    "Localizer",
    "LogError",
    "MapError",
    "McLocError",
    "Mosaic",
    "OccupancyGrid",
    "Odometry",
    "Run",
    "RunConfig",
    "Scan",
    "Sightings",
    "StateError",
    "Team",
    "Teammates",
    "Trajectory",
    "TruthError",
    "UpdatePolicy",
    "__version__",
    "evaluate",
    "read_log",
    "read_map",
    "read_trajectory",
    "read_truth",
    "restore",
    "save",
    "write_tum",
]

_ROOMS = {
    "mcloc.config": ("RunConfig",),
    "mcloc.errors": (
        "ConfigError",
        "FilterError",
        "LogError",
        "MapError",
        "McLocError",
        "StateError",
        "TruthError",
    ),
    "mcloc.estimate": ("Hypothesis",),
    "mcloc.evaluation": ("Accuracy", "evaluate"),
    "mcloc.events": ("BeaconRanges", "Detection", "Image", "Odometry", "Scan", "Sightings"),
    "mcloc.filters.catalog": ("Composition",),
    "mcloc.io.bag_map": ("read_map",),
    "mcloc.io.bag_truth": ("read_truth",),
    "mcloc.io.log": ("read_log",),
    "mcloc.io.tum": ("read_trajectory", "write_tum"),
    "mcloc.localizer": ("Estimate", "Localizer", "UpdatePolicy"),
    "mcloc.localizer.state": ("restore", "save"),
    "mcloc.maps.beacons": ("Beacons",),
    "mcloc.maps.landmarks": ("Landmarks",),
    "mcloc.maps.mosaic": ("Mosaic",),
    "mcloc.maps.occupancy": ("OccupancyGrid",),
    "mcloc.maps.teammates": ("Teammates",),
    "mcloc.report": ("Run",),
    "mcloc.team.team": ("Team",),
    "mcloc.trajectory": ("Trajectory",),
}
_ROOM_OF = {name: room for room, names in _ROOMS.items() for name in names}


def __getattr__(name: str) -> object:
    if name not in _ROOM_OF:
        raise AttributeError(f"module 'mcloc' has no attribute {name!r}")
    value: object = getattr(import_module(_ROOM_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
