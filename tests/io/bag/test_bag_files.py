"""Damaged, unfinished and misplaced bags: each is refused in a line with a remedy."""

import os
import shutil
import sqlite3

import pytest
import yaml
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter

from mcloc.errors import LogError
from mcloc.io.log import read_log


def file_of(path):
    if path.is_file():
        return path
    return next(file for file in sorted(path.iterdir()) if file.name != "metadata.yaml")


def refused(path, *reasons):
    with pytest.raises(LogError) as raised:
        list(read_log(path))
    said = str(raised.value)
    assert said.startswith(str(path))
    assert len(said.splitlines()) == 1
    for reason in reasons:
        assert reason in said
    return said


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.98])
def test_a_cut_file(write, ros, kind, share):
    path = write(ros.drive(50), kind)
    file = file_of(path)
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    refused(path)


def test_a_file_of_nothing(write, ros, kind):
    path = write(ros.drive(), kind)
    file_of(path).write_bytes(b"")
    refused(path, "empty" if path.is_file() else "cannot be read")


@pytest.mark.parametrize("kind", ["ros1", "mcap", "sqlite"])
def test_damage_says_what_may_mend_it(write, ros, kind):
    path = write(ros.drive(), kind)
    file = file_of(path)
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])
    remedy = {"ros1": "rosbag reindex", "mcap": "mcap recover", "sqlite": ".recover"}
    refused(file, remedy[kind])
    refused(path, "reindex")


@pytest.mark.parametrize("kind", ["ros1", "independent zstd"])
def test_events_before_the_damage_are_delivered(write, ros, kind):
    """The damage is within a chunk; the index at the end of the file is whole."""
    path = write(ros.drive(4000), kind)
    content = bytearray(path.read_bytes())
    half = len(content) // 2
    content[half : half + 2000] = b"\xff" * 2000
    path.write_bytes(content)
    events = []
    with pytest.raises(LogError, match="cannot be read as"):
        events.extend(read_log(path))
    assert 2000 < len(events) < 6000


def test_a_killed_recorder_of_ros_1_leaves_no_index(write, ros):
    path = write(ros.drive(), "ros1")
    content = path.read_bytes()
    at = content.index(b"index_pos=") + len(b"index_pos=")
    path.write_bytes(content[:at] + bytes(8) + content[at + 8 :])
    refused(path, "not indexed", "rosbag reindex")


def test_an_empty_bag(write, kind):
    path = write([], kind)
    refused(path, "holds no sensor_msgs/LaserScan; its topics: none")


def test_what_is_no_bag_at_all(tmp_path):
    (tmp_path / "a.bag").write_bytes(b"#ROSBAG V1.2\n" + b"x" * 100)
    refused(tmp_path / "a.bag", "102")
    (tmp_path / "b.bag").write_bytes(b"PK\x03\x04" + bytes(100))
    refused(tmp_path / "b.bag", "not a log", "ROS bags")
    (tmp_path / "c.db3").write_bytes(b"SQLite format 3\0" + bytes(100))
    refused(tmp_path / "c.db3", "cannot be read")
    (tmp_path / "empty").mkdir()
    refused(tmp_path / "empty", "directory without a bag")


def test_other_databases_are_no_bags(tmp_path):
    connection = sqlite3.connect(tmp_path / "other.db3")
    connection.execute("CREATE TABLE songs(name TEXT)")
    connection.commit()
    connection.close()
    refused(tmp_path / "other.db3", "missing tables")


@pytest.mark.parametrize("kind", ["sqlite", "mcap"])
def test_the_name_must_fit_the_content(write, ros, tmp_path, kind):
    file = file_of(write(ros.drive(), kind))
    shutil.copy(file, tmp_path / "drive.log")
    refused(tmp_path / "drive.log", f"end in {file.suffix}")
    shutil.copy(write(ros.drive(), "ros1", "other"), tmp_path / "ros1.log")
    assert len(list(read_log(tmp_path / "ros1.log"))) == 10


def test_bags_that_are_compressed_as_a_whole(write, ros, tmp_path):
    file = file_of(write(ros.drive(), "mcap"))
    packed = tmp_path / "packed" / "drive.mcap.zstd"
    packed.parent.mkdir()
    packed.write_bytes(zstandard.compress(file.read_bytes()))
    refused(packed, "zstd -d")
    refused(packed.parent, "metadata.yaml")


def test_of_many_files_the_damaged_one_is_named(write, ros, tmp_path):
    for name in "ab":
        write(ros.drive(), "ros1", name)
    (tmp_path / "b.bag").write_bytes(b"#ROSBAG V2.0\n")
    refused(tmp_path, f"{tmp_path / 'b.bag'}: cannot be read")


def test_a_folder_of_two_kinds(write, ros, tmp_path):
    shutil.copy(file_of(write(ros.drive(), "mcap", "a")), tmp_path / "z.mcap")
    write(ros.drive(), "ros1", "b")
    refused(tmp_path, ".bag, .mcap")


@pytest.mark.parametrize("kind", ["sqlite", "mcap"])
@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda text: "", "cannot be read as a ROS 2 bag"),
        (lambda text: text[: len(text) // 2], "cannot be read as a ROS 2 bag"),
        (lambda text: "[" * 1000, "reindex"),
        (lambda text: text.replace("version: 8", "version: 99"), "99"),
        (lambda text: text.replace("storage_identifier: ", "storage_identifier: x"), "xsqlite3"),
        (lambda text: text.replace("cdr", "json"), "json"),
        (lambda text: yaml.safe_dump({"rosbag2_bagfile_information": None}), "reindex"),
    ],
)
def test_spoilt_metadata(write, ros, kind, change, reason):
    path = write(ros.drive(), kind)
    metadata = path / "metadata.yaml"
    metadata.write_text(change(metadata.read_text()))
    refused(path, reason.replace("sqlite3", "sqlite3" if kind == "sqlite" else "mcap"))


def test_a_file_that_metadata_names_is_missing(write, ros):
    path = write(ros.drive(), "mcap")
    file_of(path).rename(path / "other.mcap")
    refused(path, "missing", "drive.mcap")


def indexed(path, folder, **options):
    """The messages of an MCAP file, written again with fewer indexes."""
    target = folder / "again.mcap"
    with path.open("rb") as source, target.open("wb") as stream:
        writer = McapWriter(stream, chunk_size=4096, **options)
        writer.start(profile="ros2", library="")
        channels = {}
        for schema, channel, message in make_reader(source).iter_messages():
            if channel.topic not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "cdr", known)
            writer.add_message(
                channels[channel.topic], message.log_time, message.data, message.publish_time
            )
        writer.finish()
    return target


@pytest.mark.parametrize(
    "options",
    [
        {"use_chunking": False},
        {"compression": CompressionType.LZ4, "use_statistics": False},
        {"index_types": IndexType.NONE},
        {"index_types": IndexType.NONE, "use_statistics": False, "repeat_channels": False},
        {"use_summary_offsets": False, "enable_crcs": False},
    ],
)
def test_mcap_files_with_less_than_ros_writes(write, ros, tmp_path, options):
    path = indexed(write(ros.drive(50), "independent"), tmp_path, **options)
    assert len(list(read_log(path))) == 100


@pytest.mark.parametrize("counts", [True, False])
def test_an_mcap_file_without_an_index_of_messages_is_refused(write, ros, tmp_path, counts):
    """rosbags would pass over its chunks in silence."""
    options = {"index_types": IndexType.CHUNK, "use_statistics": counts}
    path = indexed(write(ros.drive(), "independent"), tmp_path, **options)
    refused(path, "not one message of /odom", "index")


def test_an_mcap_file_of_another_profile_or_schema(tmp_path):
    path = tmp_path / "other.mcap"
    for profile, schema, reason in [("", "ros2msg", "Profile"), ("ros2", "protobuf", "protobuf")]:
        with path.open("wb") as stream:
            writer = McapWriter(stream)
            writer.start(profile=profile, library="")
            channel = writer.register_channel(
                "/a", schema, writer.register_schema("A", schema, b"")
            )
            writer.add_message(channel, 1, b"", 1)
            writer.finish()
        refused(path, reason)


def test_paths_that_are_no_files(tmp_path):
    refused(tmp_path / "missing.bag", "cannot be opened")
    os.mkfifo(tmp_path / "pipe.bag")
    refused(tmp_path / "pipe.bag", "not a regular file")
    with pytest.raises(LogError, match="cannot be opened"):
        read_log("a\0b")
