"""Bags that ROS itself wrote are read as the numbers that went in: two lasers, one of them upside
down at the end of a chain of frames, odometry, a map and a truth.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcloc.errors import LogError
from mcloc.events import Event, Odometry, Scan
from mcloc.geometry import compose
from mcloc.io.bag_map import read_map
from mcloc.io.bag_truth import read_truth
from mcloc.io.log import read_log

START = 1_700_000_000
STEPS = 12
BEAMS = 5
FRONT = (0.25, 0.05, 0.1)  # mounts: m, m, rad
MAST, REAR = (-0.3, 0.0, math.pi), (0.05, 0.02, 0.2)
CELLS = [[0, 0, 100], [0, -1, 37]]
ORIGIN = (-1.5, 2.25, 0.5)

Messages = list[dict[str, Any]]


def stamp(step: int) -> dict[str, int]:
    return {"sec": START + step // 4, "nanosec": 250_000_001 * (step % 4)}


def seconds(step: int) -> float:
    return START + step // 4 + 0.250_000_001 * (step % 4)


def odometry(step: int) -> tuple[float, float, float]:
    return 0.1 * step, -0.02 * step, 0.3 * step - math.pi


def truth(step: int) -> tuple[float, float, float]:
    return 5.0 + 0.11 * step, 2.0, 0.31 * step - math.pi + 1e-3


def ranges(step: int) -> list[float]:
    """Beyond the range, not a number, and three returns that float32 does not hold exactly."""
    return [math.inf, math.nan, 1.1 + step, 2.2, 3.3]


def quaternion(yaw: float, upside_down: bool = False) -> dict[str, float]:
    """Turned about x by π first where it hangs upside down."""
    c, s = math.cos(yaw / 2), math.sin(yaw / 2)
    return {"x": c, "y": s, "z": 0.0, "w": 0.0} if upside_down else {"x": 0, "y": 0, "z": s, "w": c}


def header(step: int, frame: str) -> dict[str, Any]:
    return {"stamp": stamp(step), "frame_id": frame}


def placed(
    step: int, parent: str, child: str, at: tuple[float, float, float], upside_down: bool = False
) -> dict[str, Any]:
    return {
        "header": header(step, parent),
        "child_frame_id": child,
        "transform": {
            "translation": {"x": at[0], "y": at[1], "z": 0.4},
            "rotation": floats(quaternion(at[2], upside_down)),
        },
    }


def floats(values: dict[str, float]) -> dict[str, float]:
    return {key: float(value) for key, value in values.items()}


def pose(at: tuple[float, float, float]) -> dict[str, Any]:
    return {
        "position": {"x": at[0], "y": at[1], "z": 0.0},
        "orientation": floats(quaternion(at[2])),
    }


def scan(step: int, frame: str) -> dict[str, Any]:
    return {
        "header": header(step, frame),
        "angle_min": -0.7,
        "angle_max": 0.7,
        "angle_increment": 0.35,
        "range_min": 0.1,
        "range_max": 30.5,
        "ranges": ranges(step),
    }


def drive() -> Messages:
    """All of it, in order of time."""
    messages: Messages = []

    def add(topic: str, kind: str, step: int, message: dict[str, Any]) -> None:
        at = stamp(step)
        messages.append(
            {
                "topic": topic,
                "type": kind,
                "stamp": [at["sec"], at["nanosec"] + 1000],  # recorded a little later
                "message": message,
            }
        )

    fixed = [
        placed(0, "base_link", "front", FRONT),
        placed(0, "base_link", "mast", MAST),
        placed(0, "mast", "rear_laser", REAR, upside_down=True),
    ]
    grid = {
        "header": header(0, "map"),
        "info": {"resolution": 0.05, "width": 3, "height": 2, "origin": pose(ORIGIN)},
        "data": [cell for row in CELLS for cell in row],
    }
    add("/tf_static", "tf2_msgs/TFMessage", 0, {"transforms": fixed})
    add("/map", "nav_msgs/OccupancyGrid", 0, grid)
    for step in range(STEPS):
        moved = {
            "header": header(step, "odom"),
            "child_frame_id": "base_link",
            "pose": {"pose": pose(odometry(step))},
        }
        add("/odom", "nav_msgs/Odometry", step, moved)
        wheels = [placed(step, "odom", "base_link", odometry(step))]
        add("/tf", "tf2_msgs/TFMessage", step, {"transforms": wheels})
        add("/scan", "sensor_msgs/LaserScan", step, scan(step, "front"))
        add("/rear/scan", "sensor_msgs/LaserScan", step, scan(step, "rear_laser"))
        true = {"header": header(step, "map"), "pose": pose(truth(step))}
        add("/truth", "geometry_msgs/PoseStamped", step, true)
    return messages


BAGS = [
    ("ros1", "drive.bag", "none"),
    ("ros1", "drive.bag", "bz2"),
    ("ros1", "drive.bag", "lz4"),
    ("ros2", "drive.mcap", "none"),
    ("ros2", "drive.mcap", "zstd"),
    ("ros2", "drive.mcap", "lz4"),
    ("ros2", "drive.db3", "none"),
]


@pytest.fixture(scope="session", params=BAGS, ids=lambda bag: "-".join(bag))
def bag(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The drive as each kind of bag."""
    ros, name, compression = request.param
    path = tmp_path_factory.mktemp("bag") / name
    request.getfixturevalue(ros).write(drive(), path, compression)
    return path


def events(bag: Path, **topics: Any) -> list[Event]:
    log = read_log(bag, topics=topics or None)
    found = list(log)
    assert log.skipped == {}
    return found


def check_odometry(found: list[Odometry]) -> None:
    assert len(found) == STEPS
    for step, event in enumerate(found):
        assert event.t == pytest.approx(seconds(step), abs=1e-6)
        np.testing.assert_allclose(event.pose, odometry(step), atol=1e-12)


def test_odometry(bag: Path) -> None:
    check_odometry([event for event in events(bag) if isinstance(event, Odometry)])


def test_odometry_from_transforms(bag: Path) -> None:
    found = events(bag, odometry="/tf", scan="/scan")
    check_odometry([event for event in found if isinstance(event, Odometry)])


@pytest.mark.parametrize("source", ["/scan", "/rear/scan"])
def test_scans(bag: Path, source: str) -> None:
    found = [e for e in events(bag) if isinstance(e, Scan) and e.source == source]
    assert len(found) == STEPS
    steps = np.float32(-0.7) + np.float32(0.35) * np.arange(BEAMS, dtype=np.float64)
    if source == "/scan":
        mount, angles = np.array(FRONT), steps
    else:
        mount, angles = compose(np.array(MAST), np.array(REAR)), -steps
    for step, event in enumerate(found):
        assert event.t == pytest.approx(seconds(step), abs=1e-6)
        np.testing.assert_array_equal(event.ranges, np.float32(ranges(step)).astype(np.float64))
        np.testing.assert_allclose(event.angles, angles, atol=1e-12)
        np.testing.assert_allclose(event.mount, mount, atol=1e-12)
        assert (event.range_min, event.range_max) == (np.float32(0.1), np.float32(30.5))
        assert event.returned.tolist() == [False, False, True, True, True]


def test_events_come_as_they_were_recorded(bag: Path) -> None:
    kinds = [event.source if isinstance(event, Scan) else "/odom" for event in events(bag)]
    assert kinds == ["/odom", "/scan", "/rear/scan"] * STEPS


def test_map(bag: Path) -> None:
    grid = read_map(bag, "/map")
    assert grid.cells.tolist() == CELLS
    assert grid.resolution == 0.05
    np.testing.assert_allclose(grid.origin, ORIGIN, atol=1e-12)


def test_truth(bag: Path) -> None:
    path = read_truth(bag, "/truth")
    np.testing.assert_allclose(path.t, [seconds(step) for step in range(STEPS)], atol=1e-6)
    np.testing.assert_allclose(path.poses, [truth(step) for step in range(STEPS)], atol=1e-12)


def test_a_cut_bag_is_told(bag: Path, tmp_path: Path) -> None:
    cut = tmp_path / bag.name
    cut.write_bytes(bag.read_bytes()[: bag.stat().st_size * 2 // 3])
    with pytest.raises(LogError, match=cut.name):
        list(read_log(cut))
