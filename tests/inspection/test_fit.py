"""Map and log together: a log fits its own map, and not a mirrored, another or a smaller one."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mcloc.events import Event, Scan
from mcloc.inspection import Finding, Fit, LogInspection, inspect_fit
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation import SimulatedDrive, office_world

Inspect = Callable[[Iterable[Event]], LogInspection]
Recorded = Callable[[str], tuple[Event, ...]]
Simulated = Callable[[int], SimulatedDrive]

FEW = 14  # scans, a move apart: fewer than ten pairs that tell
OWN = {
    "wean/robotdata1": "wean/wean.dat.gz",
    "wean/robotdata3": "wean/wean.dat.gz",
    "wean/robotdata4": "wean/wean.dat.gz",
    "wean/robotdata_1then4": "wean/wean.dat.gz",
    "intel/intel_test0": "intel/intel_train.yaml",
    "intel/intel_all": "intel/intel_full.yaml",
    "fhw/fhw_test0": "fhw/fhw_train.yaml",
    "fhw/fhw_all": "fhw/fhw_full.yaml",
    "freiburg-079/freiburg-079_test0": "freiburg-079/freiburg-079_train.yaml",
    "malaga/scans": "malaga/map.yaml",
}


def together(
    inspect: Inspect, grid: OccupancyGrid, events: Iterable[Event]
) -> tuple[Fit, list[Finding]]:
    log = inspect(events)
    return inspect_fit(grid, log, log.findings())


@pytest.mark.parametrize("name", OWN)
def test_recorded_logs_look_right(inspect: Inspect, recorded: Recorded, name: str) -> None:
    assert inspect(recorded(name)).findings() == []


@pytest.mark.slow
@pytest.mark.parametrize("name", OWN)
def test_recorded_logs_fit_their_maps(
    inspect: Inspect, recorded: Recorded, data_dir: Path, name: str
) -> None:
    fit, found = together(inspect, OccupancyGrid.load(data_dir / OWN[name]), recorded(name))
    assert (fit.verdict, found) == ("fits", [])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fhw/fhw_test0", "intel/intel_test0", "malaga/scans"])
def test_recorded_logs_do_not_fit_another_map(
    inspect: Inspect, recorded: Recorded, data_dir: Path, name: str
) -> None:
    """Whether that is certain depends on how much of the other map is walls."""
    other = "malaga/map.yaml" if name != "malaga/scans" else "wean/wean.dat.gz"
    fit, _ = together(inspect, OccupancyGrid.load(data_dir / other), recorded(name))
    assert fit.verdict in ("does not fit", "undecided")


@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(s, marks=pytest.mark.slow) for s in range(2, 12))]
)
def test_simulated_drives_fit_their_worlds(
    inspect: Inspect, simulated: Simulated, seed: int
) -> None:
    drive = simulated(seed)
    fit, found = together(inspect, drive.grid, drive.events)
    assert (fit.verdict, found) == ("fits", [])


def test_a_mirrored_map_is_named(inspect: Inspect, simulated: Simulated) -> None:
    drive = simulated(1)
    flipped = replace(drive.grid, cells=drive.grid.cells[::-1])
    fit, (finding,) = together(inspect, flipped, drive.events)
    assert fit.verdict == "does not fit"
    assert finding.check == "map-mirrored"


@pytest.mark.slow
def test_another_world_is_not_called_right(inspect: Inspect, simulated: Simulated) -> None:
    fit, _ = together(inspect, office_world(7), simulated(1).events)
    assert fit.verdict in ("does not fit", "undecided")
    assert fit.explained is not None
    assert fit.explained < 0.9


def test_a_map_of_the_wrong_scale_is_too_small(inspect: Inspect, simulated: Simulated) -> None:
    drive = simulated(1)
    small = replace(drive.grid, resolution=0.2 * drive.grid.resolution)
    fit, (finding,) = together(inspect, small, drive.events)
    assert (fit.verdict, finding.check) == ("does not fit", "map-too-small")


def test_a_turned_laser_of_a_log_too_short_to_tell_is_named(
    inspect: Inspect, simulated: Simulated
) -> None:
    """So few moves that scans and odometry alone do not tell."""
    drive = simulated(1)
    used = inspect(drive.events).windows.chosen[0][:FEW]
    short = inspect([replace(scan, ranges=scan.ranges[::-1].copy()) for scan in used])
    assert short.findings() == []
    fit, (finding,) = inspect_fit(drive.grid, short, [])
    assert fit.verdict == "does not fit"
    assert finding.check == "laser-does-not-fit-map"


def test_what_looks_wrong_by_itself_is_not_compared(inspect: Inspect, simulated: Simulated) -> None:
    drive = simulated(1)
    turn = np.array([0.0, 0.0, np.pi / 2.0])
    turned = [replace(e, mount=e.mount + turn) if isinstance(e, Scan) else e for e in drive.events]
    fit, found = together(inspect, drive.grid, turned)
    assert (fit, found) == (Fit("not compared"), [])
    assert inspect_fit(drive.grid, inspect(drive.events[:10]), []) == (Fit("not compared"), [])


def test_faults_of_the_clock_do_not_keep_from_comparing(
    inspect: Inspect, simulated: Simulated
) -> None:
    drive = simulated(1)
    middle = len(drive.events) // 2
    jumped = [
        replace(event, t=event.t + (3600.0 if k >= middle else 0.0))
        for k, event in enumerate(drive.events)
    ]
    log = inspect(jumped)
    found = log.findings()
    assert {finding.check for finding in found} == {"clock-jumps-forward"}
    fit, more = inspect_fit(drive.grid, log, found)
    assert (fit.verdict, more) == ("fits", [])
    assert np.isfinite(fit.explained or np.nan)
