"""What a robot's other sensors record along a simulated drive, as the files that `mcloc run` reads
beside the log. Each draws apart from the others: with or without them the drive is the same.

They work at 2.5 Hz each, at stamps of odometry, and not at those of each other or of a laser.
"""

from pathlib import Path

import numpy as np

from mcloc.io.beacons import write_beacon_ranges
from mcloc.io.images import write_images
from mcloc.maps.beacons import write_beacons
from mcloc.simulation.ceiling import ceiling_mosaic
from mcloc.simulation.ceiling_camera import CeilingCamera
from mcloc.simulation.drive import SimulatedDrive
from mcloc.simulation.radio import Radio

RANGED, PICTURED = slice(2, None, 8), slice(6, None, 8)  # of the poses of a drive
RADIO, CAMERA = 5, 6  # children of the seed; `simulate` takes those before


def write_beacons_heard(
    drive: SimulatedDrive, seed: int, folder: str | Path, radio: Radio | None = None
) -> dict[str, Path]:
    """Write beacons.csv and ranges.csv; where they are, by the options of `mcloc run`.

    Raises MapError for a world without walls for the beacons, McLocError where nothing can be
    written.
    """
    radio = radio or Radio()
    rng = _random(seed, RADIO)
    files = {"beacons": Path(folder) / "beacons.csv", "beacon_ranges": Path(folder) / "ranges.csv"}
    beacons = radio.placed(drive.grid, rng)
    t, poses = drive.truth.t[RANGED], drive.truth.poses[RANGED]
    write_beacons(beacons, files["beacons"])
    write_beacon_ranges(files["beacon_ranges"], beacons, radio.measure(beacons, t, poses, rng))
    return files


def write_ceiling_seen(
    drive: SimulatedDrive, seed: int, folder: str | Path, camera: CeilingCamera | None = None
) -> dict[str, Path]:
    """Write ceiling.yaml with its image, and the folder images; where they are, by the options of
    `mcloc run`. Raises McLocError where nothing can be written.
    """
    camera = camera or CeilingCamera()
    files = {"ceiling": Path(folder) / "ceiling.yaml", "images": Path(folder) / "images"}
    mosaic = ceiling_mosaic(drive.grid, seed)
    t, poses = drive.truth.t[PICTURED], drive.truth.poses[PICTURED]
    mosaic.save(files["ceiling"])
    write_images(files["images"], camera.images(mosaic, t, poses, _random(seed, CAMERA)))
    return files


def _random(seed: int, child: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(child,)))
