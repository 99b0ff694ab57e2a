"""A drive as a bag and as a CARMEN log, read by others."""

from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from mcloc.errors import ConfigError
from mcloc.events import Event, Odometry, Scan
from mcloc.io.log import read_log
from mcloc.io.tum import read_trajectory
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation import SimulatedDrive, write_drive

REAR = np.array([-0.2, 0.0, np.pi])


def messages(folder: Path) -> dict[str, list[Any]]:
    found = defaultdict(list)
    with (folder / "log.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            found[channel.topic].append(message)
    return found


def seconds(message: Any) -> float:
    return float(message.header.stamp.sec + message.header.stamp.nanosec * 1e-9)


def planar(position: Any, orientation: Any) -> list[float]:
    return [position.x, position.y, 2.0 * np.arctan2(orientation.z, orientation.w)]


@pytest.fixture
def two_lasers(drive: SimulatedDrive) -> SimulatedDrive:
    """Each scan once more, as from a laser at the back."""
    events: list[Event] = []
    for event in drive.events:
        events.append(event)
        if isinstance(event, Scan):
            events.append(replace(event, t=event.t + 0.01, source="rear", mount=REAR))
    return replace(drive, events=tuple(events))


def test_the_bag_holds_what_was_simulated(drive: SimulatedDrive, tmp_path: Path) -> None:
    write_drive(drive, tmp_path, "mcap")
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        *("log", "map.pgm", "map.yaml", "truth.csv")
    ]
    bag = messages(tmp_path / "log")
    odometry = [event for event in drive.events if isinstance(event, Odometry)]
    scans = [event for event in drive.events if isinstance(event, Scan)]
    truth = drive.truth.at(np.array([scan.t for scan in scans]))

    for message, placed, event in zip(bag["/odom"], bag["/tf"], odometry, strict=True):
        (transform,) = placed.transforms
        assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
        assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_link")
        assert seconds(message) == seconds(transform) == pytest.approx(event.t, abs=1.1e-9)
        pose = message.pose.pose
        moved = transform.transform
        np.testing.assert_allclose(planar(pose.position, pose.orientation), event.pose, atol=1e-12)
        np.testing.assert_allclose(
            planar(moved.translation, moved.rotation), event.pose, atol=1e-12
        )

    (mount,) = [t for message in bag["/tf_static"] for t in message.transforms]
    assert mount.header.frame_id == "base_link"
    laser = planar(mount.transform.translation, mount.transform.rotation)
    np.testing.assert_allclose(laser, scans[0].mount)
    for message, pose, scan, true in zip(
        bag["/" + scans[0].source], bag["/ground_truth/pose"], scans, truth, strict=True
    ):
        assert message.header.frame_id == mount.child_frame_id
        assert seconds(message) == seconds(pose) == pytest.approx(scan.t)
        np.testing.assert_array_equal(np.float32(message.ranges), np.float32(scan.ranges))
        read = planar(pose.pose.position, pose.pose.orientation)
        np.testing.assert_allclose(read[:2], true[:2])
        np.testing.assert_allclose(np.exp(1j * read[2]), np.exp(1j * true[2]))


def test_map_and_truth_are_the_same_in_both_formats(drive: SimulatedDrive, tmp_path: Path) -> None:
    for format in ("carmen", "mcap"):
        write_drive(drive, tmp_path / format, format)
    for name in ("map.pgm", "map.yaml", "truth.csv"):
        carmen, mcap = ((tmp_path / format / name).read_bytes() for format in ("carmen", "mcap"))
        assert carmen == mcap
    assert OccupancyGrid.load(tmp_path / "mcap" / "map.yaml").cells.shape == drive.grid.cells.shape
    assert len(read_trajectory(tmp_path / "mcap" / "truth.csv")) > 0


def test_one_drive_is_the_same_bytes_also_in_the_place_of_another(
    drive: SimulatedDrive, two_lasers: SimulatedDrive, tmp_path: Path
) -> None:
    write_drive(two_lasers, tmp_path / "b", "mcap")
    for folder in ("a", "b"):
        write_drive(drive, tmp_path / folder, "mcap")
    for name in ("log.mcap", "metadata.yaml"):
        first, second = ((tmp_path / folder / "log" / name).read_bytes() for folder in ("a", "b"))
        assert first == second


def test_each_laser_has_a_topic_and_a_frame(two_lasers: SimulatedDrive, tmp_path: Path) -> None:
    write_drive(two_lasers, tmp_path, "mcap")
    bag = messages(tmp_path / "log")
    front = next(event.source for event in two_lasers.events if isinstance(event, Scan))
    assert len(bag["/rear"]) == len(bag["/" + front])
    placed = {
        t.child_frame_id: planar(t.transform.translation, t.transform.rotation)
        for t in bag["/tf_static"][-1].transforms
    }
    assert placed.keys() == {"rear", front}
    np.testing.assert_allclose(placed["rear"], REAR, atol=1e-12)


def test_a_carmen_log_holds_a_laser_at_the_back(two_lasers: SimulatedDrive, tmp_path: Path) -> None:
    write_drive(two_lasers, tmp_path, "carmen")
    read = [event for event in read_log(tmp_path / "log.gz") if isinstance(event, Scan)]
    ours = [event for event in two_lasers.events if isinstance(event, Scan)]
    for a, b in zip(read, ours, strict=True):
        assert abs(a.t - b.t) < 1e-6
        assert a.range_max == b.range_max
        np.testing.assert_allclose(a.mount[:2], b.mount[:2], atol=1e-5)
        np.testing.assert_allclose(np.exp(1j * a.mount[2]), np.exp(1j * b.mount[2]), atol=1e-5)


def test_what_a_carmen_log_cannot_hold(drive: SimulatedDrive, tmp_path: Path) -> None:
    scan = next(event for event in drive.events if isinstance(event, Scan))
    narrow = replace(scan, angles=scan.angles / 2.0)
    with pytest.raises(ConfigError, match=r"half around.* mcap"):
        write_drive(replace(drive, events=(narrow,)), tmp_path, "carmen")
    left, right = (replace(scan, source=source) for source in ("left", "right"))
    with pytest.raises(ConfigError, match=r"left, right.* mcap"):
        write_drive(replace(drive, events=(left, right)), tmp_path, "carmen")


def test_a_format_that_is_not_known(drive: SimulatedDrive, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="did you mean 'carmen'"):
        write_drive(drive, tmp_path, "carman")


@pytest.mark.parametrize("format", ["carmen", "mcap"])
def test_a_folder_that_cannot_be(drive: SimulatedDrive, tmp_path: Path, format: str) -> None:
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(ConfigError, match=r"file/drive: cannot be written to"):
        write_drive(drive, tmp_path / "file" / "drive", format)
