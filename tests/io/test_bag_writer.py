"""Bags as two other readers see them: mcap with mcap-ros2-support, and rosbags' own."""

import resource
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation

from mcloc.errors import ConfigError
from mcloc.events import Odometry, Scan
from mcloc.io.bag_writer import BagWriter
from mcloc.io.ros_messages import nanoseconds
from mcloc.maps.occupancy import OccupancyGrid

ANGLES = np.linspace(-2.0, 2.0, 5)
SCAN = Scan(
    1.7e9 + 0.25,
    np.array([1.5, np.inf, 2.25, np.nan, 0.1]),
    ANGLES,
    range_max=8.0,
    mount=np.array([0.2, -0.1, 0.5]),
    range_min=0.05,
    source="/base_scan",
)
POSE = np.array([1.0, -2.0, 2.5])


def messages(folder: Path) -> list[tuple[str, int, Any]]:
    """(topic, time of recording in ns, message) of all messages, decoded by mcap-ros2-support."""
    with (folder / f"{folder.name}.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, message.log_time, decoded)
            for _, channel, message, decoded in reader.iter_decoded_messages()
        ]


def only(folder: Path) -> Any:
    """The single message of a bag."""
    ((_, _, message),) = messages(folder)
    return message


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Write a bag by calls of the writer's methods; its folder."""

    def write(*calls: Callable[[BagWriter], None], name: str = "bag") -> Path:
        with BagWriter(tmp_path / name) as bag:
            for call in calls:
                call(bag)
        return tmp_path / name

    return write


def everything(bag: BagWriter) -> None:
    """One message of each kind."""
    cells = np.array([[-1, 0, 100], [50, 0, -1]], dtype=np.int8)
    bag.grid("/map", 1.0, OccupancyGrid(cells, 0.05, np.array([1.0, 2.0, 0.3])))
    bag.odometry("/odom", Odometry(2.0, POSE))
    bag.transform(2.0, "odom", "base_link", POSE)
    bag.pose("/truth", 3.0, POSE)
    bag.pose("/amcl_pose", 3.0, POSE, np.diag([0.1, 0.2, 0.3]))
    bag.cloud("/particle_cloud", 3.5, np.array([POSE, -POSE]))
    bag.path("/path", [3.0, 4.0], [POSE, -POSE])
    bag.scan(SCAN)


def test_a_scan(write: Callable[..., Path]) -> None:
    static, (topic, at, message) = messages(write(lambda bag: bag.scan(SCAN)))
    assert static[0] == "/tf_static"
    assert (topic, at) == ("/base_scan", 1_700_000_000_250_000_000)
    assert message.header.frame_id == "base_scan"
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1_700_000_000, 250_000_000)
    np.testing.assert_array_equal(np.float32(message.ranges), np.float32(SCAN.ranges))
    k = np.arange(len(message.ranges))
    np.testing.assert_allclose(message.angle_min + k * message.angle_increment, ANGLES, atol=1e-6)
    assert message.angle_max == pytest.approx(2.0)
    assert (message.range_min, message.range_max) == pytest.approx((0.05, 8.0))


@pytest.mark.parametrize(
    "angles",
    [ANGLES[::-1], np.array([0.0]), np.array([2.0, 3.0, 4.0 - 2 * np.pi, 5.0 - 2 * np.pi])],
    ids=["to the right", "one beam", "across π"],
)
def test_beams_point_where_they_did(write: Callable[..., Path], angles: Any) -> None:
    scan = replace(SCAN, angles=angles, ranges=np.ones(len(angles)))
    *_, (_, _, message) = messages(write(lambda bag: bag.scan(scan)))
    read = message.angle_min + np.arange(len(angles)) * message.angle_increment
    np.testing.assert_allclose(np.exp(1j * read), np.exp(1j * angles), atol=1e-6)


@pytest.mark.parametrize("angles", [[], [0.0, 1.0, 1.5], [0.0, np.nan, 1.0]])
def test_a_scan_that_ros_cannot_express(write: Callable[..., Path], angles: Any) -> None:
    scan = replace(SCAN, angles=np.array(angles), ranges=np.ones(len(angles)))
    with pytest.raises(ConfigError, match=r"/base_scan.*(equal steps|no beams)"):
        write(lambda bag: bag.scan(scan))


def test_limits_beyond_float32_are_infinite(write: Callable[..., Path]) -> None:
    scan = replace(SCAN, ranges=np.full(5, 1e300), range_max=1e300)
    *_, (_, _, message) = messages(write(lambda bag: bag.scan(scan)))
    assert np.isinf(message.ranges).all()
    assert np.isinf(message.range_max)


@pytest.mark.parametrize("theta", [0.0, 0.3, -2.5, np.pi])
def test_a_heading_is_a_turn_about_z(write: Callable[..., Path], theta: float) -> None:
    pose = np.array([1.0, -2.0, theta])
    odometry = only(write(lambda bag: bag.odometry("/odom", Odometry(1.0, pose)), name="a"))
    (placed,) = only(
        write(lambda bag: bag.transform(1.0, "odom", "base", pose), name="b")
    ).transforms
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    assert (placed.header.frame_id, placed.child_frame_id) == ("odom", "base")
    expected = Rotation.from_euler("z", theta)
    for at, turn in (
        (odometry.pose.pose.position, odometry.pose.pose.orientation),
        (placed.transform.translation, placed.transform.rotation),
    ):
        assert (at.x, at.y, at.z) == (1.0, -2.0, 0.0)
        read = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])
        assert (read * expected.inv()).magnitude() < 1e-7


def test_a_covariance_is_of_x_y_and_the_turn_about_z(write: Callable[..., Path]) -> None:
    covariance = np.array([[1.0, 0.2, 0.3], [0.2, 4.0, 0.5], [0.3, 0.5, 9.0]])
    message = only(write(lambda bag: bag.pose("/amcl_pose", 1.0, POSE, covariance)))
    rows = np.reshape(message.pose.covariance, (6, 6))
    expected = {
        **{(0, 0): 1.0, (1, 1): 4.0, (5, 5): 9.0},
        **{(0, 1): 0.2, (1, 0): 0.2, (0, 5): 0.3, (5, 0): 0.3, (1, 5): 0.5, (5, 1): 0.5},
    }
    for at, value in np.ndenumerate(rows):
        assert value == expected.get(at, 0.0)  # type: ignore[call-overload]


def test_a_cell_of_a_turned_grid_lies_where_it_did(write: Callable[..., Path]) -> None:
    rng = np.random.default_rng(1)
    cells = rng.choice(np.array([-1, 0, 37, 100], dtype=np.int8), (4, 7))
    grid = OccupancyGrid(cells, 0.25, np.array([3.0, -1.0, 0.7]))
    message = only(write(lambda bag: bag.grid("/map", 1.0, grid)))
    info = message.info
    assert (info.width, info.height, info.resolution) == (7, 4, 0.25)
    q, at = info.origin.orientation, info.origin.position
    turn = Rotation.from_quat([q.x, q.y, q.z, q.w])
    for index, value in enumerate(message.data):
        row, column = divmod(index, info.width)
        centre = turn.apply([(column + 0.5) * info.resolution, (row + 0.5) * info.resolution, 0.0])
        assert grid.cells[grid.cell_of([at.x + centre[0], at.y + centre[1], 0.0])] == value


def test_a_cloud_and_a_path(write: Callable[..., Path]) -> None:
    poses = np.array([[1.0, 2.0, 0.5], [3.0, 4.0, -0.5]])
    cloud = only(write(lambda bag: bag.cloud("/cloud", 5.0, poses), name="a"))
    path = only(write(lambda bag: bag.path("/path", [5.0, 6.5], list(poses)), name="b"))
    assert cloud.header.frame_id == path.header.frame_id == "map"
    assert [pose.header.stamp.sec for pose in path.poses] == [5, 6]
    assert (path.header.stamp.sec, path.header.stamp.nanosec) == (6, 500_000_000)
    for read in (cloud.poses, [stamped.pose for stamped in path.poses]):
        table = [
            [p.position.x, p.position.y, 2.0 * np.arctan2(p.orientation.z, p.orientation.w)]
            for p in read
        ]
        np.testing.assert_allclose(table, poses)


def test_each_laser_is_placed_once_and_no_message_forgets_another(
    write: Callable[..., Path],
) -> None:
    rear = replace(SCAN, source="rear", mount=np.array([-0.3, 0.0, np.pi]))
    rounded = replace(SCAN, mount=SCAN.mount + 1e-6)
    moved = replace(SCAN, mount=SCAN.mount + np.array([0.0, 0.1, 0.0]))
    scans = [SCAN, rear, rounded, rear, moved]
    bag = messages(write(*(lambda bag, scan=scan: bag.scan(scan) for scan in scans)))
    placed = [
        {t.child_frame_id: t.transform.translation.y for t in message.transforms}
        for topic, _, message in bag
        if topic == "/tf_static"
    ]
    assert placed == [
        {"base_scan": -0.1},
        {"base_scan": -0.1, "rear": 0.0},
        {"base_scan": 0.0, "rear": 0.0},
    ]
    assert [topic for topic, _, _ in bag if topic != "/tf_static"].count("/rear") == 2


def test_types_and_encodings(write: Callable[..., Path]) -> None:
    folder = write(everything)
    with (folder / "bag.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert {index.compression for index in summary.chunk_indexes} == {"zstd"}
    schemas = summary.schemas
    assert {schema.encoding for schema in schemas.values()} == {"ros2msg"}
    assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
    assert {c.topic: schemas[c.schema_id].name for c in summary.channels.values()} == {
        "/map": "nav_msgs/msg/OccupancyGrid",
        "/odom": "nav_msgs/msg/Odometry",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/tf_static": "tf2_msgs/msg/TFMessage",
        "/truth": "geometry_msgs/msg/PoseStamped",
        "/amcl_pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
        "/particle_cloud": "geometry_msgs/msg/PoseArray",
        "/path": "nav_msgs/msg/Path",
        "/base_scan": "sensor_msgs/msg/LaserScan",
    }


def test_players_keep_the_map_and_fixed_frames(write: Callable[..., Path]) -> None:
    """Durability 1 is transient local, 2 volatile (rmw/types.h); depth counts what is kept."""
    folder = write(everything)
    metadata = yaml.safe_load((folder / "metadata.yaml").read_text())
    info = metadata["rosbag2_bagfile_information"]
    listed = {
        topic["topic_metadata"]["name"]: topic["topic_metadata"]["offered_qos_profiles"]
        for topic in info["topics_with_message_count"]
    }
    with (folder / "bag.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    within = {c.topic: c.metadata["offered_qos_profiles"] for c in summary.channels.values()}
    assert listed.keys() == within.keys()
    for profiles in (listed, within):
        for topic, text in profiles.items():
            (profile,) = yaml.safe_load(text)
            latched = topic in ("/map", "/tf_static")
            assert (profile["durability"], profile["depth"]) == ((1, 1) if latched else (2, 10))
            assert (profile["reliability"], profile["history"]) == (1, 1)


def test_rosbags_reads_the_same(write: Callable[..., Path]) -> None:
    folder = write(everything)
    with AnyReader([folder]) as reader:
        read = [
            (connection.topic, t, reader.deserialize(data, connection.msgtype))
            for connection, t, data in reader.messages()
        ]
    ours = messages(folder)
    assert [entry[:2] for entry in read] == [entry[:2] for entry in ours]
    for (_, _, a), (_, _, b) in zip(read, ours, strict=True):
        assert_same(a, b)


def assert_same(a: Any, b: Any) -> None:
    """That two decoders found the same in a message."""
    if hasattr(a, "__msgtype__"):
        for name in (name for name in a.__dataclass_fields__ if name != "__msgtype__"):
            assert_same(getattr(a, name), getattr(b, name))
    elif isinstance(a, list):
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            assert_same(x, y)
    else:
        np.testing.assert_array_equal(a, b)


@given(st.floats(0.0, 2**31, exclude_max=True))
def test_stamps_are_rounded_to_nanoseconds(t: float) -> None:
    stamp = nanoseconds(t)
    assert stamp > 0  # 0 means in ROS that there is no stamp
    # (t - whole) * 1e9 is rounded to a double below 10⁹: off by less than 10⁻⁷ ns.
    assert stamp == 1 or abs(Fraction(stamp, 10**9) - Fraction(t)) <= Fraction(0.5 + 1e-7) / 10**9


@pytest.mark.parametrize("t", [-1e-9, 2.0**31, 1e300, np.inf, np.nan])
def test_stamps_that_ros_cannot_express(write: Callable[..., Path], t: float) -> None:
    with pytest.raises(ConfigError, match="stamp of a bag"):
        write(lambda bag: bag.pose("/pose", t, POSE))


@pytest.mark.parametrize("topic", ["pose", "/", "/a pose", "/pose/", "/1st", "/a//b", ""])
def test_a_topic_must_have_a_name_that_ros_takes(write: Callable[..., Path], topic: str) -> None:
    with pytest.raises(ConfigError, match="no name of a ROS topic"):
        write(lambda bag: bag.pose(topic, 1.0, POSE))


def test_a_topic_has_one_type(write: Callable[..., Path]) -> None:
    with pytest.raises(ConfigError, match=r"/pose holds .*PoseStamped, .*Odometry too"):
        write(
            lambda bag: bag.pose("/pose", 1.0, POSE),
            lambda bag: bag.odometry("/pose", Odometry(1.0, POSE)),
        )


def test_the_same_values_are_the_same_bytes(tmp_path: Path) -> None:
    for place in ("a", "b"):
        with BagWriter(tmp_path / place / "bag") as bag:
            everything(bag)
    for name in ("bag.mcap", "metadata.yaml"):
        first, second = ((tmp_path / place / "bag" / name).read_bytes() for place in ("a", "b"))
        assert first == second


class _StopError(Exception):
    pass


def stop(_: BagWriter) -> None:
    raise _StopError


def test_what_came_before_an_interruption_can_be_read(
    write: Callable[..., Path], tmp_path: Path
) -> None:
    with pytest.raises(_StopError):
        write(everything, stop)
    assert len(messages(tmp_path / "bag")) == 9
    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.message_count == 9
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]


def test_an_interruption_before_the_first_message_leaves_an_earlier_bag(
    write: Callable[..., Path], tmp_path: Path
) -> None:
    write(everything)
    with pytest.raises(_StopError):
        write(stop)
    assert len(messages(tmp_path / "bag")) == 9
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]


def test_an_earlier_bag_is_replaced(write: Callable[..., Path], tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / ".bag.unfinished" / "bag").mkdir(parents=True)  # somebody pulled the plug
    for call in (everything, lambda bag: bag.pose("/pose", 1.0, POSE)):
        write(call)
    assert [topic for topic, _, _ in messages(tmp_path / "bag")] == ["/pose"]
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]


def test_anything_else_is_not_replaced(write: Callable[..., Path], tmp_path: Path) -> None:
    write(everything)
    (tmp_path / "bag" / "notes.txt").write_text("dear diary")
    (tmp_path / "file").write_text("a file")
    for name in ("bag", "file"):
        with pytest.raises(ConfigError, match=f"{tmp_path / name}: .*new folder"):
            write(everything, name=name)
    assert (tmp_path / "bag" / "notes.txt").exists()
    assert (tmp_path / "file").exists()


def test_a_place_where_no_folder_can_be(write: Callable[..., Path], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("a file")
    with pytest.raises(ConfigError, match=r"file/bag: .*cannot be written"):
        write(everything, name="file/bag")


@pytest.fixture
def full_disk() -> Iterator[Callable[[], None]]:
    """No file may grow beyond 200 kB, until this is called."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)

    def make_room() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))

    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, hard))
    yield make_room
    make_room()


@pytest.mark.parametrize(
    ("scans", "room_again"),
    [(40, False), (400, False), (400, True)],
    ids=["at the end", "on the way", "on the way alone"],
)
def test_of_a_bag_that_cannot_be_written_nothing_is_left(
    full_disk: Callable[[], None],
    write: Callable[..., Path],
    tmp_path: Path,
    scans: int,
    room_again: bool,
) -> None:
    """A chunk is a megabyte, so that 40 scans of 8 kB are written when the bag is closed."""
    write(everything)
    rng = np.random.default_rng(1)  # noise, which does not compress
    noisy = [
        replace(SCAN, ranges=ranges, angles=np.linspace(-2.0, 2.0, 2000))
        for ranges in rng.uniform(0.0, 8.0, (scans, 2000))
    ]

    def record(bag: BagWriter) -> None:
        try:
            for scan in noisy:
                bag.scan(scan)
        finally:
            if room_again:
                full_disk()

    with pytest.raises(ConfigError, match=f"{tmp_path / 'bag'}: .*cannot be written"):
        write(record)
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]
    assert len(messages(tmp_path / "bag")) == 9
