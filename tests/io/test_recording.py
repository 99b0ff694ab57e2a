"""A recorded run, decoded by mcap-ros2-support: what it shows is what was estimated."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mcloc.geometry import compose
from mcloc.io.recording import Recording, thinned
from mcloc.localizer import Estimate, Localizer
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.particles import Particles
from mcloc.simulation import SimulatedDrive, office_drive

Messages = dict[str, list[Any]]


@pytest.fixture(scope="module")
def drive() -> SimulatedDrive:
    return office_drive(seed=2, length=4.0)


@pytest.fixture(scope="module")
def estimates(drive: SimulatedDrive) -> list[Estimate]:
    start = drive.truth.poses[0]
    return list(Localizer(drive.grid, seed=1, initial=start).run(drive.events))


def record(folder: Path, grid: OccupancyGrid, estimates: Sequence[Estimate]) -> Messages:
    with Recording(folder, grid) as recording:
        for estimate in estimates:
            recording.add(estimate)
    return messages(folder)


def messages(folder: Path) -> Messages:
    """The messages of each topic."""
    found = defaultdict(list)
    with (folder / f"{folder.name}.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            found[channel.topic].append(message)
    return found


@pytest.fixture(scope="module")
def recorded(
    drive: SimulatedDrive, estimates: list[Estimate], tmp_path_factory: pytest.TempPathFactory
) -> Messages:
    return record(tmp_path_factory.mktemp("run") / "bag", drive.grid, estimates)


def seconds(message: Any) -> float:
    return float(message.header.stamp.sec + message.header.stamp.nanosec * 1e-9)


def matrix(translation: Any, rotation: Any) -> NDArray[np.float64]:
    """(4, 4): of a frame in its parent."""
    placed = np.eye(4)
    placed[:3, 3] = translation.x, translation.y, translation.z
    turn = Rotation.from_quat([rotation.x, rotation.y, rotation.z, rotation.w])
    placed[:3, :3] = turn.as_matrix()
    return placed


def in_map(recorded: Messages, t: float, frame: str) -> NDArray[np.float64]:
    """(4, 4): the pose of a frame in the map, found as a viewer finds it, from child to parent."""
    transforms = [t for message in recorded["/tf_static"] for t in message.transforms]
    for message in recorded["/tf"]:
        transforms += [placed for placed in message.transforms if abs(seconds(placed) - t) < 1e-6]
    parents = {placed.child_frame_id: placed for placed in transforms}
    pose = np.eye(4)
    while frame != "map":
        placed = parents[frame]
        pose = matrix(placed.transform.translation, placed.transform.rotation) @ pose
        frame = placed.header.frame_id
    return pose


def test_each_estimate_is_a_pose_with_covariance(
    recorded: Messages, estimates: list[Estimate]
) -> None:
    assert len(estimates) > 20
    for message, estimate in zip(recorded["/amcl_pose"], estimates, strict=True):
        assert seconds(message) == pytest.approx(estimate.t)
        assert message.header.frame_id == "map"
        read = matrix(message.pose.pose.position, message.pose.pose.orientation)
        np.testing.assert_allclose(read[:2, 3], estimate.pose[:2])
        np.testing.assert_allclose(np.arctan2(read[1, 0], read[0, 0]), estimate.pose[2])
        planar = np.reshape(message.pose.covariance, (6, 6))[np.ix_([0, 1, 5], [0, 1, 5])]
        np.testing.assert_array_equal(planar, estimate.covariance)


def test_the_frames_lead_from_the_laser_to_the_map(
    recorded: Messages, estimates: list[Estimate]
) -> None:
    for estimate in estimates:
        laser = in_map(recorded, estimate.t, "laser")
        expected = compose(estimate.pose, estimate.measurement.mount)
        np.testing.assert_allclose(laser[:2, 3], expected[:2], atol=1e-9)
        np.testing.assert_allclose(laser[:2, 0], [np.cos(expected[2]), np.sin(expected[2])])


def test_scans_end_at_the_walls(
    recorded: Messages, drive: SimulatedDrive, estimates: list[Estimate]
) -> None:
    """As a viewer draws them: the frames, the angles and the map have to agree."""
    used = [estimate for estimate in estimates if estimate.updated]
    assert 1 < len(used) < len(estimates)
    for scan, estimate in zip(recorded["/laser"], used, strict=True):
        assert seconds(scan) == pytest.approx(estimate.t)
        r = np.array(scan.ranges)
        hits = np.flatnonzero(np.isfinite(r) & (r < scan.range_max))
        angles, r = scan.angle_min + hits * scan.angle_increment, r[hits]
        ends = np.array([np.cos(angles) * r, np.sin(angles) * r, 0.0 * r, 1.0 + 0.0 * r])
        x, y, _, _ = in_map(recorded, seconds(scan), scan.header.frame_id) @ ends
        rows, columns = drive.grid.cell_of(np.stack([x, y, 0.0 * x], axis=-1))
        near = np.zeros(len(x), dtype=bool)
        for i in range(-3, 4):  # cells of 5 cm, the estimate is off by some too
            for j in range(-3, 4):
                near |= drive.grid.occupied[rows + i, columns + j]
        assert near.mean() > 0.8


def test_the_map_comes_first_and_once(recorded: Messages, drive: SimulatedDrive) -> None:
    assert next(iter(recorded)) == "/map"
    (grid,) = recorded["/map"]
    assert (grid.info.height, grid.info.width) == drive.grid.cells.shape
    np.testing.assert_array_equal(grid.data, drive.grid.cells.ravel())


def test_the_particles_of_each_update(recorded: Messages, estimates: list[Estimate]) -> None:
    used = [estimate for estimate in estimates if estimate.updated]
    for cloud, estimate in zip(recorded["/particle_cloud"], used, strict=True):
        assert seconds(cloud) == pytest.approx(estimate.t)
        states = {tuple(state) for state in estimate.update.particles.states[:2].T}
        assert {(pose.position.x, pose.position.y) for pose in cloud.poses} <= states


def test_the_path_is_repeated_when_it_has_doubled(
    recorded: Messages, estimates: list[Estimate]
) -> None:
    lengths = [len(path.poses) for path in recorded["/path"]]
    doubled = [2**k for k in range(20) if 2**k <= len(estimates)]
    assert lengths == doubled + [len(estimates)] * (doubled[-1] < len(estimates))
    assert sum(lengths) <= 3 * len(estimates)
    for pose, estimate in zip(recorded["/path"][-1].poses, estimates, strict=True):
        assert seconds(pose) == pytest.approx(estimate.t)
        assert (pose.pose.position.x, pose.pose.position.y) == tuple(estimate.pose[:2])


def test_two_lasers(drive: SimulatedDrive, estimates: list[Estimate], tmp_path: Path) -> None:
    (first, second) = [estimate for estimate in estimates if estimate.updated][:2]
    rear = replace(second.measurement, source="/rear/scan", mount=np.array([-0.2, 0.0, np.pi]))
    recorded = record(tmp_path / "bag", drive.grid, [first, replace(second, measurement=rear)])
    assert [len(recorded[topic]) for topic in ("/laser", "/rear/scan")] == [1, 1]
    laser = in_map(recorded, second.t, "rear/scan")
    np.testing.assert_allclose(laser[:2, 3], compose(second.pose, rear.mount)[:2])


def test_a_recording_that_is_interrupted(
    drive: SimulatedDrive, estimates: list[Estimate], tmp_path: Path
) -> None:
    def cut() -> None:
        with Recording(tmp_path / "bag", drive.grid) as recording:
            for estimate in estimates[:7]:
                recording.add(estimate)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cut()
    recorded = messages(tmp_path / "bag")
    assert len(recorded["/amcl_pose"]) == len(recorded["/path"][-1].poses) == 7


def test_the_same_estimates_are_the_same_bytes(
    drive: SimulatedDrive, estimates: list[Estimate], tmp_path: Path
) -> None:
    for place in ("a", "b"):
        record(tmp_path / place / "bag", drive.grid, estimates[:5])
    for name in ("bag.mcap", "metadata.yaml"):
        first, second = ((tmp_path / place / "bag" / name).read_bytes() for place in ("a", "b"))
        assert first == second


@given(
    st.lists(st.floats(-30.0, 0.0), min_size=1, max_size=40),
    st.integers(1, 60),
)
def test_thinned_particles_lie_as_densely_as_they_weigh(
    log_weights: list[float], most: int
) -> None:
    """Each is drawn n w times, up to less than one: the property of a systematic sweep."""
    states = np.array([np.arange(len(log_weights)), np.zeros(len(log_weights))] * 2)[:3]
    particles = Particles.normalized(states.astype(float), np.array(log_weights))
    poses = thinned(particles, most)
    assert len(poses) == min(most, len(particles))
    times = np.bincount(poses[:, 0].astype(int), minlength=len(particles))
    assert (np.abs(times - len(poses) * particles.weights) < 1.0 + 1e-9).all()
