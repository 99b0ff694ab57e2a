"""A drive under a ceiling as files: what `mcloc run --ceiling` reads, and the truth."""

import gzip
from pathlib import Path

import numpy as np

from mcloc.errors import ConfigError
from mcloc.events import Image, Odometry
from mcloc.io.images import write_images
from mcloc.simulation.ceiling_drive import CeilingDrive


def write_ceiling_drive(drive: CeilingDrive, folder: str | Path) -> None:
    """Write map.yaml and ceiling.yaml with their images, the odometry as the CARMEN log log.gz, the
    folder images/, and truth.csv (`t,x,y,theta` at each image). Raises McLocError where nothing can
    be written.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        drive.grid.save(folder / "map.yaml")
        drive.mosaic.save(folder / "ceiling.yaml")
        with gzip.GzipFile(folder / "log.gz", "wb", mtime=0) as log:
            for event in drive:
                if isinstance(event, Odometry):
                    log.write(f"{_odom(event)}\n".encode())
        write_images(folder / "images", (e for e in drive if isinstance(e, Image)))
        np.savetxt(
            folder / "truth.csv",
            np.column_stack([drive.truth.t, drive.truth.poses]),
            fmt="%.6f",
            delimiter=",",
            header="t,x,y,theta",
            comments="",
        )
    except OSError as cause:
        raise ConfigError(f"{folder}: cannot be written to ({cause.strerror})") from cause


def _odom(odometry: Odometry) -> str:
    x, y, theta = odometry.pose.tolist()
    stamp = f"{odometry.t:.6f}"
    return f"ODOM {x:.6f} {y:.6f} {theta:.6f} 0 0 0 {stamp} simulation {stamp}"
