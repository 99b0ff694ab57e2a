"""Bags that mcloc writes hold for ROS itself the numbers that went in."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcloc.events import Odometry, Scan
from mcloc.geometry import compose, wrap
from mcloc.io.bag_writer import BagWriter
from mcloc.io.recording import Recording
from mcloc.localizer import Localizer
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation import office_drive

T = 1_700_000_000.25
MOUNT = np.array([0.2, 0.1, 0.5])
POSE = np.array([1.5, -2.5, 3.0])
COVARIANCE = np.array([[0.04, 0.01, 0.002], [0.01, 0.09, 0.003], [0.002, 0.003, 0.01]])
RANGES = np.array([math.inf, math.nan, 1.1, 2.2])
ANGLES = np.linspace(-0.6, 0.6, 4)
GRID = OccupancyGrid(np.array([[0, 0, 100], [0, -1, 37]]), 0.05, np.array([-1.0, 2.0, 0.5]))
CLOUD = np.array([[0.0, 1.0, 2.0], [3.0, 4.0, -1.0]])


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The MCAP file of a bag with one message of each kind, two lasers and two paths."""
    folder = tmp_path_factory.mktemp("written") / "bag"
    with BagWriter(folder) as bag:
        bag.grid("/map", T, GRID)
        for source, mount in (("front", MOUNT), ("back", -MOUNT)):
            scan = Scan(T, RANGES, ANGLES, 30.0, mount, range_min=0.1, source=source)
            bag.scan(scan)
        bag.odometry("/odom", Odometry(T + 1, POSE))
        bag.transform(T + 1, "odom", "base_link", POSE)
        bag.pose("/truth", T + 2, POSE)
        bag.pose("/estimate", T + 2, POSE, COVARIANCE)
        bag.cloud("/particles", T + 3, CLOUD)
        bag.path("/path", [T, T + 3], list(CLOUD))
    (file,) = folder.glob("*.mcap")
    return file


@pytest.fixture(scope="module")
def messages(ros2: Any, written: Path) -> list[dict[str, Any]]:
    """As ROS reads them."""
    found: list[dict[str, Any]] = ros2.read(written)
    return found


@pytest.fixture
def on(messages: list[dict[str, Any]]) -> Any:
    """The messages on a topic."""
    return lambda topic: [entry["message"] for entry in messages if entry["topic"] == topic]


def seconds(header: dict[str, Any]) -> float:
    return float(header["stamp"]["sec"] + 1e-9 * header["stamp"]["nanosec"])


def planar(pose: dict[str, Any]) -> list[float]:
    """x, y, θ of a Pose or a Transform that lies flat."""
    p = pose.get("position") or pose["translation"]
    q = pose.get("orientation") or pose["rotation"]
    assert (p["z"], q["x"], q["y"]) == (0.0, 0.0, 0.0)
    return [p["x"], p["y"], 2.0 * math.atan2(q["z"], q["w"])]


def test_no_byte_is_left_over(messages: list[dict[str, Any]]) -> None:
    assert len(messages) == 11
    assert all(entry["whole"] for entry in messages)


def test_types(messages: list[dict[str, Any]]) -> None:
    assert {entry["topic"]: entry["type"] for entry in messages} == {
        "/map": "nav_msgs/OccupancyGrid",
        "/tf_static": "tf2_msgs/TFMessage",
        "/front": "sensor_msgs/LaserScan",
        "/back": "sensor_msgs/LaserScan",
        "/odom": "nav_msgs/Odometry",
        "/tf": "tf2_msgs/TFMessage",
        "/truth": "geometry_msgs/PoseStamped",
        "/estimate": "geometry_msgs/PoseWithCovarianceStamped",
        "/particles": "geometry_msgs/PoseArray",
        "/path": "nav_msgs/Path",
    }


def test_the_time_of_recording(messages: list[dict[str, Any]]) -> None:
    stamps = [entry["stamp"][0] + 1e-9 * entry["stamp"][1] for entry in messages]
    assert stamps == sorted(stamps)
    assert stamps[0] == T


@pytest.mark.parametrize("source", ["front", "back"])
def test_scan(on: Any, source: str) -> None:
    (scan,) = on(f"/{source}")
    assert seconds(scan["header"]) == T
    assert scan["header"]["frame_id"] == source
    np.testing.assert_array_equal(scan["ranges"], np.float32(RANGES).astype(np.float64))
    angles = scan["angle_min"] + scan["angle_increment"] * np.arange(4)
    np.testing.assert_allclose(angles, ANGLES, atol=1e-6)
    assert scan["angle_max"] == pytest.approx(0.6)
    assert (scan["range_min"], scan["range_max"]) == (np.float32(0.1), 30.0)


def test_mounts(on: Any) -> None:
    """The last message holds them all."""
    mounts = {t["child_frame_id"]: t for t in on("/tf_static")[-1]["transforms"]}
    assert {t["header"]["frame_id"] for t in mounts.values()} == {"base_link"}
    np.testing.assert_allclose(planar(mounts["front"]["transform"]), MOUNT, atol=1e-12)
    np.testing.assert_allclose(planar(mounts["back"]["transform"]), -MOUNT, atol=1e-12)


def test_odometry(on: Any) -> None:
    (odometry,), (moved,) = on("/odom"), on("/tf")
    assert seconds(odometry["header"]) == T + 1
    assert (odometry["header"]["frame_id"], odometry["child_frame_id"]) == ("odom", "base_link")
    np.testing.assert_allclose(planar(odometry["pose"]["pose"]), POSE, atol=1e-12)
    np.testing.assert_allclose(planar(moved["transforms"][0]["transform"]), POSE, atol=1e-12)


def test_map(on: Any) -> None:
    (grid,) = on("/map")
    assert (grid["info"]["width"], grid["info"]["height"]) == (3, 2)
    assert grid["data"] == GRID.cells.ravel().tolist()
    assert grid["info"]["resolution"] == np.float32(0.05)
    np.testing.assert_allclose(planar(grid["info"]["origin"]), GRID.origin, atol=1e-12)


def test_poses(on: Any) -> None:
    (truth,), (estimate,) = on("/truth"), on("/estimate")
    assert seconds(truth["header"]) == seconds(estimate["header"]) == T + 2
    assert truth["header"]["frame_id"] == "map"
    np.testing.assert_allclose(planar(truth["pose"]), POSE, atol=1e-12)
    np.testing.assert_allclose(planar(estimate["pose"]["pose"]), POSE, atol=1e-12)
    whole = np.reshape(estimate["pose"]["covariance"], (6, 6))
    np.testing.assert_array_equal(whole[np.ix_([0, 1, 5], [0, 1, 5])], COVARIANCE)


def test_many_poses(on: Any) -> None:
    (cloud,), (path,) = on("/particles"), on("/path")
    np.testing.assert_allclose([planar(pose) for pose in cloud["poses"]], CLOUD, atol=1e-12)
    stamped = path["poses"]
    np.testing.assert_allclose([planar(each["pose"]) for each in stamped], CLOUD, atol=1e-12)
    assert [seconds(each["header"]) for each in stamped] == [T, T + 3]


def test_a_recorded_run(ros2: Any, tmp_path: Path) -> None:
    """For ROS, map → odom → base_link is the pose that was published beside it."""
    drive = office_drive(seed=2, length=4.0)
    localizer = Localizer(drive.grid, seed=1, initial=drive.truth.poses[0])
    folder = tmp_path / "run"
    with Recording(folder, drive.grid) as recording:
        estimates = list(localizer.run(replace(e, t=e.t + 1.0) for e in drive.events))
        for estimate in estimates:
            recording.add(estimate)
    (file,) = folder.glob("*.mcap")
    found = ros2.read(file)
    assert all(entry["whole"] for entry in found)
    transforms = [t for e in found if e["topic"] == "/tf" for t in e["message"]["transforms"]]
    of = {
        child: [planar(t["transform"]) for t in transforms if t["child_frame_id"] == child]
        for child in ("odom", "base_link")
    }
    poses = [e["message"]["pose"]["pose"] for e in found if e["topic"] == "/amcl_pose"]
    assert len(poses) == len(estimates) > 10
    joined = compose(np.array(of["odom"]), np.array(of["base_link"]))
    published = np.array([planar(pose) for pose in poses])
    np.testing.assert_allclose(joined[:, :2], published[:, :2], atol=1e-9)
    np.testing.assert_allclose(wrap(joined[:, 2] - published[:, 2]), 0.0, atol=1e-9)
    np.testing.assert_allclose(published, [e.pose for e in estimates], atol=1e-9)
