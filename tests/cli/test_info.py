"""`mcloc info`: what it tells of maps and logs, and what it says when something is wrong."""

import gzip
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcloc.events import Odometry, Scan
from mcloc.io.bag_writer import BagWriter
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation import office_drive, write_drive

Mcloc = Callable[..., Any]

MAP = {
    *("name", "width_m", "height_m", "columns", "rows", "resolution_m", "origin"),
    *("occupied_thresh", "free_thresh", "free", "occupied", "unknown"),
}
LOG = {
    *("name", "start_s", "end_s", "duration_s", "distance_m", "backward_m", "odometry", "lasers"),
    *("sightings", "truth", "skipped", "topics"),
}
LASER = {
    *(
        "events",
        "rate_hz",
        "longest_gap_s",
        "beams",
        "angles_rad",
        "range_min_m",
        "range_max_m",
        "range_median_m",
    ),
    *("missing", "missing_by_kind", "mount", "own_odometry"),
}
FINDING = {"check", "about", "what", "evidence", "remedy"}


def found(mcloc: Mcloc, *arguments: object) -> dict[str, Any]:
    def no_constant(name: str) -> None:
        raise AssertionError(f"{name} is not JSON")

    done = mcloc("info", *arguments, "--json")
    assert done.code == 0, done.stderr
    told: dict[str, Any] = json.loads(done.stdout, parse_constant=no_constant)
    assert set(told) == {"map", "log", "fit", "findings"}
    assert all(set(finding) == FINDING for finding in told["findings"])
    return told


def test_a_map_alone(mcloc: Mcloc, drive: Path) -> None:
    told = found(mcloc, drive / "map.yaml")
    grid = OccupancyGrid.load(drive / "map.yaml")
    assert set(told["map"]) == MAP
    assert told["map"]["columns"] == grid.cells.shape[1]
    assert told["map"]["free"] == pytest.approx(grid.free.mean())
    assert (told["log"], told["fit"], told["findings"]) == (None, None, [])


def test_a_log_alone(mcloc: Mcloc, drive: Path) -> None:
    told = found(mcloc, drive / "log.gz")
    assert told["map"] is None
    log = told["log"]
    assert set(log) == LOG
    events = office_drive(seed=1, length=15.0).events
    scans = [event for event in events if isinstance(event, Scan)]
    ((_, laser),) = log["lasers"].items()
    assert set(laser) == LASER
    assert laser["events"] == len(scans)
    assert log["odometry"]["events"] == len(events) - len(scans)
    assert laser["rate_hz"] == pytest.approx(5.0)
    assert log["odometry"]["rate_hz"] == pytest.approx(10.0)
    assert (log["sightings"], log["truth"]) == (None, None)
    assert laser["beams"] == 181
    assert laser["angles_rad"] == pytest.approx([-np.pi / 2, np.pi / 2])
    missing = 1.0 - np.concatenate([scan.returned for scan in scans]).mean()
    assert laser["missing"] == pytest.approx(missing)
    assert list(laser["mount"].values()) == pytest.approx(scans[0].mount, abs=1e-5)
    assert log["distance_m"] == pytest.approx(15.0, rel=0.1)
    assert told["findings"] == []


def test_both_in_any_order(mcloc: Mcloc, drive: Path) -> None:
    told = found(mcloc, drive / "map.yaml", drive / "log.gz")
    assert told["fit"]["verdict"] == "fits"
    assert told["fit"]["explained"] > 0.9
    assert told == found(mcloc, drive / "log.gz", drive / "map.yaml")


def test_for_people(mcloc: Mcloc, drive: Path) -> None:
    done = mcloc("info", drive / "map.yaml", drive / "log.gz")
    assert done.code == 0
    for words in ("21 m × 16 m", "0.05 m", "181 beams", "-90° to 90°", "5 Hz", "fits", "none"):
        assert words in done.stdout
    assert max(map(len, done.stdout.replace(str(drive), "").splitlines())) <= 100
    assert done.stderr == ""


def test_findings_are_told_with_their_remedy_and_are_no_failure(
    mcloc: Mcloc, drive: Path, tmp_path: Path
) -> None:
    text = (drive / "map.yaml").read_text().replace("negate: 0", "negate: 1")
    (tmp_path / "map.yaml").write_text(text)
    (tmp_path / "map.pgm").write_bytes((drive / "map.pgm").read_bytes())
    done = mcloc("info", tmp_path / "map.yaml", drive / "log.gz")
    assert done.code == 0
    assert "walls and free space look swapped" in done.stdout
    assert "change negate" in done.stdout
    assert "not compared" in done.stdout


def test_the_mount_that_is_told_mends_the_log(mcloc: Mcloc, tmp_path: Path) -> None:
    clean = office_drive(seed=1, length=15.0)
    turn = np.array([0.0, 0.0, np.pi])
    events = tuple(
        replace(e, mount=e.mount + turn) if isinstance(e, Scan) else e for e in clean.events
    )
    write_drive(replace(clean, events=events), tmp_path)
    (finding,) = found(mcloc, tmp_path / "log.gz")["findings"]
    assert finding["check"] == "laser-yaw"
    option, value = finding["remedy"].split()[:2]
    assert option == "--mount"
    assert found(mcloc, tmp_path / "log.gz", "--mount", value)["findings"] == []


def test_a_bag_with_its_topics(mcloc: Mcloc, tmp_path: Path) -> None:
    clean = office_drive(seed=1, length=15.0)
    write_drive(clean, tmp_path, format="mcap")
    told = found(mcloc, tmp_path / "log")
    assert told["findings"] == []
    assert told["log"]["topics"]["/odom"] == "nav_msgs/Odometry"
    scans = [topic for topic, kind in told["log"]["topics"].items() if "LaserScan" in kind]
    assert list(told["log"]["lasers"]) == scans
    chosen = found(mcloc, tmp_path / "log", "--topic", f"scan={scans[0]}")
    assert chosen == told
    wheels = sum(isinstance(event, Odometry) for event in clean.events)
    assert told["log"]["odometry"]["events"] == wheels


def test_a_map_on_a_topic_of_the_bag(mcloc: Mcloc, tmp_path: Path) -> None:
    clean = office_drive(seed=1, length=15.0)
    with BagWriter(tmp_path / "log") as bag:
        bag.grid("/map", 0.0, clean.grid)
        for event in clean.events:
            if isinstance(event, Odometry):
                bag.odometry("/odom", event)
            else:
                bag.scan(event)
    told = found(mcloc, tmp_path / "log", "--topic", "map=/map")
    assert told["map"]["columns"] == clean.grid.cells.shape[1]
    assert told["fit"]["verdict"] == "fits"
    assert told["findings"] == []


def test_a_cut_log_is_told_up_to_the_cut(mcloc: Mcloc, drive: Path, tmp_path: Path) -> None:
    content = gzip.decompress((drive / "log.gz").read_bytes())
    (tmp_path / "cut.log").write_bytes(content[: len(content) // 2])
    done = mcloc("info", tmp_path / "cut.log")
    assert done.code == 2
    assert "181 beams" in done.stdout
    assert "cut.log, line" in done.stderr


def test_ranges_in_millimetres_are_told_though_nothing_returns(
    mcloc: Mcloc, tmp_path: Path
) -> None:
    clean = office_drive(seed=1, length=15.0)
    events = tuple(
        replace(e, ranges=1e3 * e.ranges) if isinstance(e, Scan) else e for e in clean.events
    )
    write_drive(replace(clean, events=events), tmp_path)
    done = mcloc("info", tmp_path / "log.gz")
    assert done.code == 2
    assert "may be millimetres" in done.stdout
    assert "no scan with a return" in done.stderr


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["missing.yaml"], "cannot be opened"),
        (["missing.log"], "cannot be opened"),
        (["map.pgm"], "not its image"),
        (["truth.csv"], "not a log"),
        (["empty.log"], "empty"),
        (["map.yaml", "map.yaml"], "got 2 maps and 0 logs"),
        (["log.gz", "log.gz"], "got 0 maps and 2 logs"),
        (["map.yaml", "--mount", "0,0,0"], "about a log"),
        (["map.yaml", "--robot", "3"], "about a log"),
        (["log.gz", "--mount", "0,0"], "--mount takes three numbers"),
        (["log.gz", "--topic", "scan=/scan"], "topics are of ROS bags"),
        (["map.yaml", "--topic", "map=/map"], "--topic map="),
        (["log.gz", "--topic", "map=/map"], "not a ROS bag"),
        (["log.gz", "--topic", "scan"], "--topic takes role=name"),
    ],
)
def test_wrong_input_exits_with_2(
    mcloc: Mcloc, drive: Path, tmp_path: Path, names: list[str], words: str
) -> None:
    (tmp_path / "empty.log").touch()

    def path(name: str) -> object:
        found = [folder / name for folder in (drive, tmp_path) if (folder / name).exists()]
        return found[0] if found else tmp_path / name if name.startswith("missing") else name

    done = mcloc("info", *map(path, names))
    assert done.code == 2
    assert words in done.stderr
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) <= 2
