"""Where studies take place: recorded logs that MCLOC_DATA names, and worlds that are generated."""

import os
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from functools import cache, lru_cache
from pathlib import Path

from mcloc.errors import ConfigError
from mcloc.events import Event
from mcloc.experiments.table import Setting
from mcloc.io.log import read_log
from mcloc.io.tum import read_trajectory
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation import Scenario, museum_world, office_world, simulate
from mcloc.trajectory import Trajectory

VARIABLE = "MCLOC_DATA"


@dataclass(frozen=True, eq=False)
class Drive:
    """A robot's map, what it reported, and where it was."""

    grid: OccupancyGrid
    events: tuple[Event, ...]
    truth: Trajectory


@dataclass(frozen=True)
class _Files:
    map: str
    log: str
    truth: str


def _mapped(name: str) -> _Files:
    """A log with the map that was made without it."""
    log = f"{name}/{name}_test0"
    return _Files(f"{name}/{name}_train.yaml", f"{log}.log.gz", f"{log}.ref.csv")


RECORDED: Mapping[str, _Files] = {
    "fhw": _mapped("fhw"),
    "freiburg-079": _mapped("freiburg-079"),
    "intel": _mapped("intel"),
    **{
        f"wean-{k}": _Files(
            "wean/wean.dat.gz", f"wean/robotdata{k}.log.gz", f"wean/robotdata{k}.ref.csv"
        )
        for k in (1, 3, 4)
    },
}
"""Recorded logs by name: a museum, offices, a corridor."""


def missing(setting: Setting) -> str | None:
    """What the factor `place` of a setting lacks here, if it is a recorded log."""
    place = setting["place"]
    if place not in RECORDED:
        return None
    folder = os.environ.get(VARIABLE)
    if not folder:
        return f"{VARIABLE} does not name the folder of the recorded logs"
    files = RECORDED[str(place)]
    for name in (files.map, files.log, files.truth):
        if not Path(folder, name).exists():
            return f"{VARIABLE} = {folder} holds no {name}"
    return None


def files() -> list[Path]:
    """Those of the recorded logs that are there."""
    folder = os.environ.get(VARIABLE)
    named = [] if not folder else [Path(folder, n) for f in RECORDED.values() for n in astuple(f)]
    return [path for path in dict.fromkeys(named) if path.exists()]


@cache
def recorded(place: str) -> Drive:
    """A recorded log. Raises ConfigError where it is not there."""
    lacking = missing({"place": place})
    if lacking is not None:
        raise ConfigError(lacking)
    folder, files = Path(os.environ[VARIABLE]), RECORDED[place]
    return Drive(
        OccupancyGrid.load(folder / files.map),
        tuple(read_log(folder / files.log)),
        read_trajectory(folder / files.truth),
    )


@lru_cache(maxsize=1)  # runs come seed by seed, and each seed has a world of its own
def generated(world: str, seed: int, length: float) -> Drive:
    """`length` metres through a world of its own for each seed, "office" or "museum"."""
    grid = {"office": office_world, "museum": museum_world}[world](seed)
    drive = simulate(grid, seed, Scenario(length=length))
    return Drive(drive.grid, drive.events, drive.truth)


def drive(place: str, seed: int, length: float) -> Drive:
    """A recorded log as it is, or `length` metres of a generated world, "generated office" or
    "generated museum".
    """
    if place in RECORDED:
        return recorded(place)
    return generated(place.removeprefix("generated "), seed, length)
