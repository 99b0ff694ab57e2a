"""What a robot's other sensors record along a simulated drive, as the files that `mcloc run` reads
beside the log. Each draws apart from the others: with or without them the drive is the same.

They work at 2.5 Hz each, at stamps of odometry, and not at those of each other or of a laser.
"""

from pathlib import Path

import numpy as np

from mcloc.events import Odometry
from mcloc.io.beacons import write_beacon_ranges
from mcloc.io.images import write_images
from mcloc.io.mrclam_writer import write_mrclam
from mcloc.maps.beacons import write_beacons
from mcloc.simulation.ceiling import ceiling_mosaic
from mcloc.simulation.ceiling_camera import CeilingCamera
from mcloc.simulation.drive import SimulatedDrive
from mcloc.simulation.lookout import Lookout
from mcloc.simulation.radio import Radio
from mcloc.trajectory import Trajectory

RANGED, SEEN, PICTURED = (slice(k, None, 8) for k in (2, 4, 6))  # of the poses of a drive
RADIO, CAMERA, LOOKOUT = 5, 6, 7  # children of the seed; `simulate` takes those before


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


def write_landmarks_seen(
    drive: SimulatedDrive, seed: int, folder: str | Path, lookout: Lookout | None = None
) -> Path:
    """Write mrclam/, which is a log of its own, of robot 1: the drive by a robot that sees
    landmarks instead of scans; where it is.

    Raises MapError for a world without walls for the landmarks, LogError where nothing can be
    written.
    """
    lookout, rng = lookout or Lookout(), _random(seed, LOOKOUT)
    landmarks = lookout.placed(drive.grid, rng)
    t, poses = drive.truth.t[SEEN], drive.truth.poses[SEEN]
    seen = lookout.look(drive.grid, landmarks, t, poses, rng)
    odometry = [event for event in drive.events if isinstance(event, Odometry)]
    wheels = Trajectory(
        np.array([event.t for event in odometry]), np.array([event.pose for event in odometry])
    )
    where = Path(folder) / "mrclam"
    write_mrclam(where, 1, landmarks, wheels, seen, drive.truth)
    return where


def _random(seed: int, child: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(child,)))
