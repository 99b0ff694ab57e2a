"""A simulated drive as files: the map, a CARMEN log, and the truth."""

import gzip
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcloc.events import Odometry, Scan
from mcloc.geometry import compose
from mcloc.simulation.drive import SimulatedDrive

NO_RETURN = 81.83  # m, as CARMEN writes it


def write_drive(drive: SimulatedDrive, folder: str | Path) -> None:
    """Write map.yaml with its image, log.gz and truth.csv (`t,x,y,theta` at each scan)."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    drive.grid.save(folder / "map.yaml")
    scans = [event for event in drive.events if isinstance(event, Scan)]
    # No stamp of the hour in the file: one seed, the same bytes.
    with gzip.GzipFile(folder / "log.gz", "wb", mtime=0) as log:
        log.write(f"PARAM robot_front_laser_max {scans[0].range_max}\n".encode())
        for event in drive.events:
            line = _flaser(event) if isinstance(event, Scan) else _odom(event)
            log.write(f"{line}\n".encode())
    t = np.array([scan.t for scan in scans])
    np.savetxt(
        folder / "truth.csv",
        np.column_stack([t, drive.truth.at(t)]),
        fmt="%.6f",
        delimiter=",",
        header="t,x,y,theta",
        comments="",
    )


def _odom(odometry: Odometry) -> str:
    """ODOM x y θ, velocities and acceleration (not known: 0), t, host, t of the logger."""
    return f"ODOM {_numbers(odometry.pose, 6)} 0 0 0 {odometry.t:.6f} simulation {odometry.t:.6f}"


def _flaser(scan: Scan) -> str:
    """FLASER n, n ranges, x y θ of the laser, x y θ of the robot, t, host, t of the logger."""
    assert scan.odometry is not None  # `simulate` leaves none out
    ranges = _numbers(np.where(np.isfinite(scan.ranges), scan.ranges, NO_RETURN), 3)
    laser = _numbers(compose(scan.odometry, scan.mount), 6)
    robot = _numbers(scan.odometry, 6)
    return (
        f"FLASER {len(scan.ranges)} {ranges} {laser} {robot} {scan.t:.6f} simulation {scan.t:.6f}"
    )


def _numbers(values: NDArray[np.float64], digits: int) -> str:
    return " ".join(f"{value:.{digits}f}" for value in values)
