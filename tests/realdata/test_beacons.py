"""Radio beacons of a recorded log, one of which is bad: nobody says so."""

from pathlib import Path

import numpy as np
import pytest

from mcloc.config import RunConfig
from mcloc.events import BeaconRanges
from mcloc.io.beacons import read_beacon_ranges
from mcloc.io.log import changed, read_log
from mcloc.io.tum import read_trajectory
from mcloc.maps.beacons import read_beacons
from mcloc.report import Run, accuracy_of, summarize


def made(data: Path, **entries: object) -> Run:
    folder = data / "malaga"
    beacons = {
        "beacons": str(folder / "beacons.csv"),
        "beacon_ranges": str(folder / "beacon_ranges.csv"),
    }
    paths = {
        "map": str(folder / "map.yaml"),
        "log": str(folder / "scans.log.gz"),
        "truth": str(folder / "ref.csv"),
    }
    run = Run(RunConfig(**{**paths, **beacons, "seed": 5, "threads": 1, **entries}))
    for _ in run:
        pass
    return run


@pytest.mark.parametrize("start", [None, 129.5, 229.5])
def test_beacons_alone_find_the_robot_and_their_bad_one(
    data_dir: Path, start: float | None
) -> None:
    run = made(data_dir, scans=False, start=start)
    accuracy = accuracy_of(run)
    assert accuracy is not None
    assert accuracy.position_median_m < 0.3  # asked for is 1 m; the reference is good to 0.12 m
    assert accuracy.converged
    found = summarize(run, accuracy)["beacons"]
    assert found["1"]["trust"] < 0.5
    assert min(found["2"]["trust"], found["3"]["trust"]) == 1.0


def test_beacons_do_a_laser_no_harm(data_dir: Path) -> None:
    both, laser = made(data_dir), made(data_dir, beacons=None, beacon_ranges=None)
    errors = [accuracy_of(run) for run in (both, laser)]
    assert errors[0] is not None
    assert errors[1] is not None
    assert errors[0].position_median_m <= errors[1].position_median_m + 0.01
    assert summarize(both, errors[0])["beacons"]["1"]["trust"] < 0.5
    assert "beacons" not in summarize(laser, errors[1])


def test_ranges_are_those_of_their_scan(data_dir: Path) -> None:
    """To the two good beacons; a scan earlier or later they would be 0.2 m off."""
    folder = data_dir / "malaga"
    beacons = read_beacons(folder / "beacons.csv")
    truth = read_trajectory(folder / "ref.csv")
    ranges = read_beacon_ranges(folder / "beacon_ranges.csv", beacons)
    off: list[list[float]] = [[], [], []]
    for z in changed(read_log(folder / "scans.log.gz"), ranges.among):
        if isinstance(z, BeaconRanges) and z.t >= truth.t[0]:
            x, y, theta = truth.at(np.array([z.t]))[0]
            ahead, left, up = z.antenna
            at = x + np.cos(theta) * ahead - np.sin(theta) * left
            at = np.array([at, y + np.sin(theta) * ahead + np.cos(theta) * left, up])
            for beacon, r in zip(z.beacon, z.range, strict=True):
                off[beacon].append(abs(r - np.linalg.norm(beacons.places[beacon] - at)))
    assert [len(some) for some in off] == [338, 338, 338]
    assert np.nanmedian(off[1]) < 0.1
    assert np.nanmedian(off[2]) < 0.1
