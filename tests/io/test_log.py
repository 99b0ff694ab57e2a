"""What all logs have in common: sniffing, streaming, the mount, and the errors of the user."""

import gzip

import numpy as np
import pytest

from mcloc.density import FAR
from mcloc.errors import ConfigError, LogError
from mcloc.events import Scan
from mcloc.io.log import read_log, read_odometry


def flaser(x=0.0, reading="2.0", laser_x=None):
    laser_x = x if laser_x is None else laser_x
    return f"FLASER 2 {reading} {reading} {laser_x} 0 0 {x} 0 0 1.0 host 1.0\n"


@pytest.fixture
def write(tmp_path):
    def write(content, name="drive.log"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def test_the_content_tells_the_format_not_the_name(write):
    wean = "O 0 0 0 1\nL 0 0 0 25 0 0 " + "100 " * 180 + "2\n"
    for content in (flaser(), "# comment\n\n" + flaser(), wean):
        for packed in (content.encode(), gzip.compress(content.encode())):
            assert isinstance(list(read_log(write(packed, "any.csv")))[-1], Scan)


def test_a_log_can_be_read_again(write):
    log = read_log(write("SYNC a\n" + flaser() * 3))
    for _ in range(2):
        assert len(list(log)) == 3
        assert log.skipped == {"message SYNC": 1}


def test_a_log_is_read_as_it_is_asked_for(write):
    events = iter(read_log(write(flaser() + "no message follows\n" * 10**5)))
    assert isinstance(next(events), Scan)


def test_what_log_it_is(write):
    path = write(flaser())
    assert read_log(path).path == read_log(str(path)).path == str(path)


def test_a_given_mount_replaces_every_scans(write):
    (first, second) = read_log(write(flaser(laser_x=0.3) + flaser()), mount=(0.1, 0.2, 0.3))
    assert first.mount.tolist() == second.mount.tolist() == [0.1, 0.2, 0.3]


def test_the_lasers_of_one_robot_have_names(write):
    robotlaser = "ROBOTLASER1 0 -0.5 3 0.5 30 0.01 0 1 2.0 0 1 2 0 1 2 0 0 0 0 0 0 1.0 host 1.0\n"
    lines = flaser() + flaser().replace("FLASER", "RLASER") + robotlaser
    wean = "L 0 0 0 25 0 0 " + "100 " * 180 + "2\n"
    assert [scan.source for scan in read_log(write(lines))] == ["front", "rear", "front"]
    assert [scan.source for scan in read_log(write(wean))] == ["laser"]


@pytest.mark.parametrize("mount", [(0.1, 0.2), (0.1, np.nan, 0.0)])
def test_a_mount_must_be_a_pose(write, mount):
    with pytest.raises(ConfigError, match="mount must be"):
        read_log(write(flaser()), mount=mount)


def test_a_laser_that_wanders_over_the_robot_needs_a_mount(write):
    """Some logs hold, instead of the laser's pose by odometry, a pose corrected by SLAM."""
    path = write("".join(flaser(x=x, laser_x=1.1 * x) for x in range(10)))
    with pytest.raises(LogError, match="--mount"):
        list(read_log(path))
    assert len(list(read_log(path, mount=(0.0, 0.0, 0.0)))) == 10


def test_a_given_mount_is_of_one_laser(write):
    path = write(flaser() * 3 + flaser().replace("FLASER", "RLASER"))
    with pytest.raises(ConfigError, match=r"drive\.log: the mount .* several: front, rear; leave"):
        list(read_log(path, mount=(0.1, 0.0, 0.0)))
    assert len(list(read_log(path))) == 4


def test_odometry_beyond_any_map_is_skipped(write):
    wheels = "ODOM -1e300 0 0 0 0 0 1.0 host 1.0\nODOM 3 4 0 0 0 0 1.0 host 1.0\n"
    log = read_log(write(wheels + flaser(x=FAR) + flaser()))
    assert len(list(log)) == 2
    assert log.skipped == {"odometry beyond 1e+07 m": 2}


def test_odometry_alone_needs_no_mount(write):
    wandering = "".join(flaser(x=x, laser_x=1.1 * x) for x in range(10))
    path = write("ODOM nan 0 0 0 0 0 1.0 host 1.0\n" + wandering)
    assert [event.odometry[0] for event in read_odometry(path)] == list(range(10))
    with pytest.raises(ConfigError, match="topics are of ROS bags; this is CARMEN"):
        read_odometry(path, {"odometry": "/odom"})
    with pytest.raises(LogError, match="not a log"):
        read_odometry(write("Once upon a time\n"))


def test_scans_that_are_skipped_say_nothing_of_the_mount(write):
    bad = "".join(flaser(x="nan", laser_x=x) for x in range(10))
    assert len(list(read_log(write(bad + flaser())))) == 1


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "empty"),
        (gzip.compress(b"", mtime=0), "empty"),
        (gzip.compress(flaser().encode(), mtime=0)[:15], "cut or damaged"),
        (b"\x89PNG\r\n\x1a\n" + bytes(range(256)), "not a log"),
        (b"t,x,y,theta\n0,1,2,3\n", "not a log"),
        (b"# FLASER 2 nothing but comments\n", "not a log"),
        (b"Once upon a time\nL was a letter\nO was another\n", "not a log"),
    ],
)
def test_what_is_no_log_raises_at_once(write, content, reason):
    with pytest.raises(LogError, match=rf"drive\.log.*{reason}"):
        read_log(write(content))


def test_what_is_no_file_raises_at_once(tmp_path):
    for path in (tmp_path, tmp_path / "missing.log"):
        with pytest.raises(LogError, match=str(path)):
            read_log(path)


@pytest.mark.parametrize(
    "content",
    [
        "ODOM 0 0 0 0 0 0 1.0 host 1.0\n",
        "FLASER 0 0 0 0 0 0 0 1.0 host 1.0\n",
        flaser(reading="81.91"),
        flaser(reading="nan") + flaser(reading="0") + flaser(reading="-1") + flaser(reading="inf"),
    ],
)
def test_a_log_without_a_return_raises_at_its_end(write, content):
    with pytest.raises(LogError, match=r"drive\.log: holds no scan with a return"):
        list(read_log(write(content)))


def test_events_before_the_cut_of_a_gzip_log_are_delivered(write):
    rng = np.random.default_rng(1)
    lines = "".join(flaser(reading=f"{r:.6f}") for r in rng.uniform(1.0, 9.0, 5000))
    packed = gzip.compress(lines.encode())
    events = []
    with pytest.raises(LogError, match="cut or damaged") as raised:
        events.extend(read_log(write(packed[: len(packed) // 2])))
    assert 2000 < len(events) < 3000
    assert f"line {len(events) + 1}:" in str(raised.value)
