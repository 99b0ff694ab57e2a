"""The recorded logs, maps and references: all are read, and they fit each other."""

import gzip

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from mcloc.errors import LogError
from mcloc.events import Odometry, Scan
from mcloc.geometry import compose
from mcloc.io.log import read_log
from mcloc.io.tum import read_trajectory
from mcloc.maps.files import load

# log: map, scans, beams, metres driven (None: with a gap), metres from the centre to the laser
DRIVES = {
    "wean/robotdata1": ("wean/wean.dat.gz", 713, 180, 42, 0.25),
    "wean/robotdata3": ("wean/wean.dat.gz", 1241, 180, 43, 0.25),
    "wean/robotdata4": ("wean/wean.dat.gz", 600, 180, 22, 0.25),
    "wean/robotdata_1then4": ("wean/wean.dat.gz", 1313, 180, None, 0.25),
    "intel/intel_test0": ("intel/intel_train.yaml", 182, 180, 138, 0.0),
    "fhw/fhw_test0": ("fhw/fhw_train.yaml", 244, 180, 237, 0.0),
    "freiburg-079/freiburg-079_test0": (
        "freiburg-079/freiburg-079_train.yaml",
        2395,
        360,
        406,
        0.0,
    ),
    "malaga/scans": ("malaga/map.yaml", 343, 361, 112, 0.095),
}


@pytest.fixture(params=DRIVES)
def drive(request, data_dir):
    return request.param, data_dir


def read(drive):
    name, data_dir = drive
    reference = "malaga/ref.csv" if name == "malaga/scans" else f"{name}.ref.csv"
    log = read_log(data_dir / f"{name}.log.gz")
    return log, list(log), read_trajectory(data_dir / reference)


def test_every_line_is_an_event(drive):
    log, events, _ = read(drive)
    _, n, beams, _, ahead = DRIVES[drive[0]]
    scans = [event for event in events if isinstance(event, Scan)]
    odometry = [event for event in events if isinstance(event, Odometry)]
    with gzip.open(log.path, "rt") as file:
        lines = sum(not line.startswith("#") for line in file)
    assert len(scans) == n
    assert len(scans) + len(odometry) == lines
    assert log.skipped == {}
    assert {len(scan.ranges) for scan in scans} == {beams}
    mounts = np.array([scan.mount for scan in scans])
    assert mounts == pytest.approx(np.tile([ahead, 0.0, 0.0], (n, 1)), abs=1e-5)
    assert all(scan.odometry is not None for scan in scans)
    assert bool(odometry) == drive[0].startswith("wean")


def test_scans_and_references_share_their_stamps(drive):
    _, events, reference = read(drive)
    stamps = np.array([event.t for event in events if isinstance(event, Scan)])
    first = 1 if drive[0] == "malaga/scans" else 0  # its scan 0 has no reference
    assert len(reference) == len(stamps) - first
    assert np.abs(reference.t - stamps[first:]).max() <= 1e-3


@pytest.mark.parametrize("drive", [n for n in DRIVES if DRIVES[n][3]], indirect=True)
def test_wheels_and_reference_tell_of_the_same_drive(drive):
    """Units: both ways have the length known, but for slip and the reference's jitter."""
    _, events, reference = read(drive)
    length = DRIVES[drive[0]][3]
    wheels = np.array([event.odometry for event in events if isinstance(event, Scan)])
    by_wheels = np.linalg.norm(np.diff(wheels[:, :2], axis=0), axis=1).sum()
    by_reference = np.linalg.norm(np.diff(reference.poses[:, :2], axis=0), axis=1).sum()
    assert by_reference == pytest.approx(length, rel=0.05)
    assert by_wheels == pytest.approx(length, rel=0.1)


def test_scans_lie_on_the_walls_of_the_map(drive):
    """Orientation of map and beams: their mirror image must not fit."""
    name, data_dir = drive
    _, events, reference = read(drive)
    grid = load(data_dir / DRIVES[name][0])
    near_wall = np.pad(distance_transform_edt(~grid.occupied) * grid.resolution <= 0.2, 1)

    def share(mirror):
        hits = total = 0
        for scan in events:
            nearest = np.argmin(np.abs(reference.t - scan.t))
            if isinstance(scan, Odometry) or abs(reference.t[nearest] - scan.t) > 1e-3:
                continue
            valid = (scan.ranges > 0.0) & (scan.ranges < scan.range_max)
            x, y, theta = compose(reference.poses[nearest], scan.mount)
            direction = theta + mirror * scan.angles[valid]
            x, y = (
                x + scan.ranges[valid] * np.cos(direction),
                y + scan.ranges[valid] * np.sin(direction),
            )
            row, column = grid.cell_of(np.stack([x, y, direction], axis=-1))
            height, width = grid.cells.shape
            hits += near_wall[np.clip(row, -1, height) + 1, np.clip(column, -1, width) + 1].sum()
            total += valid.sum()
        return hits / total

    assert share(mirror=1) > 0.85  # 0.89 with people walking by (wean 1), else 0.91 … 0.98
    assert share(mirror=-1) < 0.6


def test_the_reference_stands_on_free_cells(drive):
    name, data_dir = drive
    _, _, reference = read(drive)
    grid = load(data_dir / DRIVES[name][0])
    assert grid.free[grid.cell_of(reference.poses)].mean() > 0.99


def test_the_wean_map(data_dir):
    grid = load(data_dir / "wean/wean.dat.gz")
    assert grid.cells.shape == (800, 800)
    assert grid.resolution == pytest.approx(0.1)
    assert (
        400 < grid.free.sum() * 0.01 < 550
    )  # m²: corridors 2 to 3 m wide, 150 m of them, and a hall
    assert 0.02 < grid.occupied.mean() < 0.05


def test_every_map_and_reference_is_read(data_dir):
    maps = [*data_dir.glob("*/*.yaml"), *data_dir.glob("*/*.dat.gz")]
    references = list(data_dir.glob("*/*ref.csv"))
    assert len(maps) >= 10
    assert len(references) >= 10
    for path in maps:
        assert load(path).free.any()
    for path in references:
        assert len(read_trajectory(path)) > 100


@pytest.mark.parametrize("name", ["wean/robotdata4", "malaga/scans"])
@pytest.mark.parametrize("packed", [True, False])
def test_a_cut_log_is_read_up_to_the_cut(data_dir, tmp_path, name, packed):
    content = (data_dir / f"{name}.log.gz").read_bytes()
    content = content if packed else gzip.decompress(content)
    path = tmp_path / "cut.log"
    path.write_bytes(content[: len(content) // 2])
    whole = [event.t for event in read_log(data_dir / f"{name}.log.gz")]
    read = []
    with pytest.raises(LogError, match=r"cut\.log, line \d+: .*cut"):
        read.extend(event.t for event in read_log(path))
    assert 0.4 * len(whole) < len(read) < 0.6 * len(whole)
    assert read == whole[: len(read)]
