"""A simulated drive as files: the map, a log, and the truth. One seed, the same bytes."""

import gzip
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.events import Odometry, Scan
from mcloc.geometry import compose
from mcloc.io.bag_writer import BASE, ODOM, BagWriter
from mcloc.io.sick import beam_angles
from mcloc.registry import suggest
from mcloc.simulation.drive import SimulatedDrive

NO_RETURN = 81.83  # m, as CARMEN writes it


def write_drive(drive: SimulatedDrive, folder: str | Path, format: str = "carmen") -> None:
    """Write map.yaml with its image, the log, and truth.csv (`t,x,y,theta` at each scan).

    format: "carmen" for log.gz, which holds one laser and one more named rear; "mcap" for the ROS 2
    bag log/, each laser on a topic of its own, the truth on /ground_truth/pose. Raises ConfigError
    for another one, for lasers that the format cannot express, and where nothing can be written.
    """
    if format not in _LOGS:
        raise ConfigError(f"unknown format {format!r} of a log; {suggest(format, _LOGS)}")
    folder = Path(folder)
    t = np.unique([event.t for event in drive.events if isinstance(event, Scan)])
    try:
        folder.mkdir(parents=True, exist_ok=True)
        drive.grid.save(folder / "map.yaml")
        _LOGS[format](drive, folder)
        np.savetxt(
            folder / "truth.csv",
            np.column_stack([t, drive.truth.at(t)]),
            fmt="%.6f",
            delimiter=",",
            header="t,x,y,theta",
            comments="",
        )
    except OSError as cause:
        raise ConfigError(f"{folder}: cannot be written to ({cause.strerror})") from cause


def _mcap(drive: SimulatedDrive, folder: Path) -> None:
    with BagWriter(folder / "log") as bag:
        for event in drive.events:
            if isinstance(event, Odometry):
                bag.odometry("/odom", event)
                bag.transform(event.t, ODOM, BASE, event.pose)
            elif isinstance(event, Scan):
                bag.scan(event)
                true = drive.truth.at(np.array([event.t]))[0]
                bag.pose("/ground_truth/pose", event.t, true)


def _carmen(drive: SimulatedDrive, folder: Path) -> None:
    scans = {event.source: event for event in drive.events if isinstance(event, Scan)}
    if len(scans.keys() - {"rear"}) > 1:
        raise ConfigError(
            f"a CARMEN log holds one laser and one named rear, not {', '.join(sorted(scans))}; "
            "write format mcap"
        )
    # No stamp of the hour in the file.
    with gzip.GzipFile(folder / "log.gz", "wb", mtime=0) as log:
        for source, scan in scans.items():
            side = "rear" if source == "rear" else "front"
            log.write(f"PARAM robot_{side}_laser_max {scan.range_max}\n".encode())
        for event in drive.events:
            if isinstance(event, Scan):
                log.write(f"{_laser(event)}\n".encode())
            elif isinstance(event, Odometry):
                log.write(f"{_odom(event)}\n".encode())


_LOGS = {"carmen": _carmen, "mcap": _mcap}


def _odom(odometry: Odometry) -> str:
    """ODOM x y θ, velocities and acceleration (not known: 0), t, host, t of the logger."""
    return f"ODOM {_numbers(odometry.pose, 6)} 0 0 0 {odometry.t:.6f} simulation {odometry.t:.6f}"


def _laser(scan: Scan) -> str:
    """FLASER n, n ranges, x y θ of the laser, x y θ of the robot, t, host, t of the logger."""
    assert scan.odometry is not None  # `simulate` leaves none out
    n = len(scan.ranges)
    if not np.allclose(scan.angles, beam_angles(n)):
        raise ConfigError(
            f"in a CARMEN log {n} beams look half around; those of {scan.source} do not, "
            "write format mcap"
        )
    word = "RLASER" if scan.source == "rear" else "FLASER"
    ranges = _numbers(np.where(np.isfinite(scan.ranges), scan.ranges, NO_RETURN), 3)
    laser = _numbers(compose(scan.odometry, scan.mount), 6)
    robot = _numbers(scan.odometry, 6)
    return f"{word} {n} {ranges} {laser} {robot} {scan.t:.6f} simulation {scan.t:.6f}"


def _numbers(values: NDArray[np.float64], digits: int) -> str:
    return " ".join(f"{value:.{digits}f}" for value in values)
