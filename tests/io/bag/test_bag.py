"""Bags of every kind and size: the same events, one at a time."""

import shutil
import sqlite3
import tracemalloc

import numpy as np
import pytest
import yaml

from mcloc.errors import LogError
from mcloc.events import Odometry, Scan
from mcloc.io.log import read_log
from mcloc.simulation import office_drive, write_drive


def check_is_the_drive(events, n=5):
    assert [type(event) for event in events] == [Odometry, Scan] * n
    odometry, scans = events[::2], events[1::2]
    np.testing.assert_allclose([o.pose for o in odometry], [[i / 2, 0, 0] for i in range(n)])
    for scan in scans:
        assert scan.ranges.dtype == np.float64
        assert scan.ranges.tolist() == [1.0, 2.0, 3.0]
        assert scan.angles.tolist() == [-0.5, 0.0, 0.5]
        assert (scan.range_min, scan.range_max) == (0.25, 8.0)
        assert scan.mount == pytest.approx([0.2, 0.0, 0.0])
        assert scan.odometry is None
        assert scan.source == "/scan"


def test_every_kind_of_bag_gives_the_same_events(write, ros, kind):
    path = write(ros.drive(), kind)
    log = read_log(path)
    assert log.path == str(path)
    for _ in range(2):  # a log can be read again
        events = list(log)
        check_is_the_drive(events)
        assert [e.t for e in events] == [ros.STAMP + i / 8 for i in range(10)]
        assert log.skipped == {}


@pytest.mark.parametrize("kind", ["sqlite", "mcap", "mcap chunks"])
def test_a_file_of_a_rosbag2_folder_is_a_bag_too(write, ros, kind):
    folder = write(ros.drive(), kind)
    (file,) = (path for path in folder.iterdir() if path.suffix in (".db3", ".mcap"))
    check_is_the_drive(list(read_log(file)))
    (folder / "metadata.yaml").unlink()
    check_is_the_drive(list(read_log(folder)))


@pytest.mark.parametrize("kind", ["ros1 lz4", "sqlite", "mcap", "independent zstd"])
def test_the_pieces_of_a_split_bag_are_one_drive(write, ros, tmp_path, kind):
    """In ROS 1 the latched transforms are in the first piece alone."""
    script = ros.drive(6)
    (tmp_path / "split").mkdir()
    for name, part, start in [("z", script[:5], 0), ("a", script[5:], 5)]:
        path = write(part, kind, f"part_{name}", start=10**18 + start * 10**9)
        files = [path] if path.is_file() else path.glob("*.[dm]*[3p]")
        for file in files:
            shutil.move(file, tmp_path / "split" / f"{name}{file.suffix}")
    check_is_the_drive(list(read_log(tmp_path / "split")), 6)


@pytest.mark.parametrize("kind", ["sqlite", "mcap"])
def test_a_rosbag2_folder_may_name_several_files(write, ros, kind):
    script = ros.drive(6)
    first = write(script[:5], kind, "first")
    second = write(script[5:], kind, "second", start=(ros.STAMP + 10) * 10**9)
    (file,) = (path for path in second.iterdir() if path.suffix in (".db3", ".mcap"))
    shutil.move(file, first / file.name)
    metadata = yaml.safe_load((first / "metadata.yaml").read_text())
    metadata["rosbag2_bagfile_information"]["relative_file_paths"].append(file.name)
    (first / "metadata.yaml").write_text(yaml.safe_dump(metadata))
    check_is_the_drive(list(read_log(first)), 6)


def test_events_come_as_recorded_with_the_stamps_of_their_headers(write, ros):
    late = [ros.odometry(ros.STAMP + 9.0), ros.scan(ros.STAMP + 2.5), ros.odometry(ros.STAMP + 1.0)]
    log = read_log(write([*ros.drive(1)[:1], *late]))
    assert [event.t - ros.STAMP for event in log] == [9.0, 2.5, 1.0]


def test_a_bag_and_a_text_log_of_one_drive_agree(write, ros, tmp_path):
    drive = office_drive(seed=1, length=4.0)
    scans = [event for event in drive.events if isinstance(event, Scan)]
    mount = scans[0].mount
    script = [ros.tf_static(ros.transform(0, "base", "laser", (*mount[:2], 0), ros.yaw(mount[2])))]
    for event in drive.events:
        if isinstance(event, Odometry):
            script.append(ros.odometry(event.t + 1.0, *event.pose))
        else:
            step = (event.angles[-1] - event.angles[0]) / (len(event.angles) - 1)
            limits = {"range_min": 0.0, "range_max": event.range_max}
            beams = {"angle_min": event.angles[0], "angle_increment": step}
            script.append(ros.scan(event.t + 1.0, ranges=event.ranges, **limits, **beams))
    write_drive(drive, tmp_path)
    from_bag, from_text = list(read_log(write(script))), list(read_log(tmp_path / "log.gz"))
    assert len(from_bag) == len(from_text) == len(drive.events)
    for ours, text, true in zip(from_bag, from_text, drive.events, strict=True):
        assert type(ours) is type(text)
        assert ours.t - 1.0 == pytest.approx(text.t, abs=1e-6)
        if isinstance(ours, Odometry):
            np.testing.assert_allclose(ours.pose, true.pose, atol=1e-12)
            np.testing.assert_allclose(ours.pose, text.pose, atol=1e-6)  # text has 6 digits
        else:
            np.testing.assert_array_equal(ours.ranges, true.ranges.astype(np.float32))
            np.testing.assert_array_equal(ours.returned, text.returned)
            np.testing.assert_allclose(
                ours.ranges[ours.returned], text.ranges[ours.returned], atol=1e-3
            )
            np.testing.assert_allclose(ours.angles, text.angles, atol=1e-5)
            np.testing.assert_allclose(ours.mount, text.mount, atol=1e-5)
            assert ours.range_max == text.range_max


@pytest.mark.parametrize("kind", ["ros1", "ros1 lz4", "sqlite", "mcap", "independent zstd"])
def test_a_large_bag_is_never_held_in_memory(write, ros, kind):
    """48 MB of images between the scans."""
    image = {
        "header": ros.header(1.0, "camera"),
        "height": 1024,
        "width": 1024,
        "encoding": "mono8",
        "is_bigendian": 0,
        "step": 1024,
        "data": np.random.default_rng(1).integers(0, 255, 2**20, dtype=np.uint8),
    }
    if kind.startswith("independent"):
        image["data"] = image["data"].tobytes()
    script = [*ros.drive(1)]
    for i in range(24):
        t = ros.STAMP + 1 + i
        script += [("/camera", "sensor_msgs/msg/Image", image)] * 2
        script += [ros.odometry(t), ros.scan(t)]
    path = write(script, kind)
    size = sum(f.stat().st_size for f in ([path] if path.is_file() else path.iterdir()))
    tracemalloc.start()
    n = sum(1 for _ in read_log(path))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert n == 2 * 25
    assert size > 48e6
    assert peak < 12e6


@pytest.mark.parametrize("ending", ["*.db3*", "*"], ids=["killed", "with metadata"])
@pytest.mark.parametrize("mode", ["wal", "delete"])
def test_an_sqlite_bag_left_open_is_neither_read_nor_touched(write, ros, tmp_path, mode, ending):
    """Killed in mid-write: the end of the drive is in the file beside, or is to be rolled back."""
    (file,) = write(ros.drive(), "sqlite").glob("*.db3")
    connection = sqlite3.connect(file)
    connection.execute(f"PRAGMA journal_mode={mode}")
    connection.execute("PRAGMA cache_size=1")  # so that changes go to the disk before the commit
    connection.execute("BEGIN IMMEDIATE")
    for _ in range(50):
        connection.execute(
            "INSERT INTO messages SELECT NULL, topic_id, timestamp, data FROM messages LIMIT 50"
        )
    if mode == "wal":
        connection.commit()
    killed = tmp_path / "killed"
    killed.mkdir()
    for path in file.parent.glob(ending):
        shutil.copy(path, killed / path.name)
    connection.close()
    before = {path: path.read_bytes() for path in killed.iterdir()}
    assert len(before) >= 2
    for path in (killed, killed / file.name):
        with pytest.raises(LogError, match=r"not closed by its recorder.*integrity_check"):
            read_log(path)
    assert {path: path.read_bytes() for path in killed.iterdir()} == before
    mended = sqlite3.connect(killed / file.name)  # the remedy
    mended.execute("PRAGMA integrity_check").fetchall()
    mended.close()
    assert len(list(read_log(killed))) >= 10
