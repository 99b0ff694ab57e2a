"""CARMEN logs, line by line, with the traps that recorded ones have laid."""

import numpy as np
import pytest

from mcloc.errors import LogError
from mcloc.events import Odometry, Scan
from mcloc.io.log import read_log

TAIL = "1.5 host 1.6"


def flaser(n=3, laser="0 0 0", robot="0 0 0", ranges=None, tail=TAIL, word="FLASER"):
    return " ".join([word, str(n), *(ranges or ["2.0"] * n), laser, robot, tail])


def robotlaser(start="-0.5", step="0.25", limit="30", ranges=("1", "2"), remissions=("7",)):
    head = ["ROBOTLASER1 0", start, "3.14", step, limit, "0.01 0"]
    readings = [str(len(ranges)), *ranges, str(len(remissions)), *remissions]
    return " ".join([*head, *readings, "1.2 2 0 1 2 0 0.1 0.2 0.5 0.4 1e6", TAIL])


@pytest.fixture
def read(tmp_path):
    def read(*lines, **options):
        path = tmp_path / "drive.log"
        path.write_text("\n".join(lines) + "\n")
        log = read_log(path, **options)
        return list(log), log.skipped

    return read


def test_a_flaser_line_is_one_scan_that_knows_its_odometry(read):
    events, skipped = read(flaser(3, "1 2 0.5", "1 2 0.5", ["0.7", "81.91", "3"]))
    (scan,) = events
    assert isinstance(scan, Scan)
    assert scan.t == 1.5  # when it was measured, not logged
    assert scan.ranges.tolist() == [0.7, 81.91, 3.0]
    assert scan.range_max == 45.0
    assert scan.odometry.tolist() == [1.0, 2.0, 0.5]
    assert scan.mount.tolist() == [0.0, 0.0, 0.0]
    assert skipped == {}


@pytest.mark.parametrize(
    ("n", "first", "second", "last"),
    [
        (180, -90, -89, 89),
        (360, -90, -89.5, 89.5),
        (181, -90, -89, 90),
        (361, -90, -89.5, 90),
        (91, -90, -88, 90),
    ],
)
def test_where_the_beams_point(read, n, first, second, last):
    (scan,), _ = read(flaser(n))
    assert np.rad2deg(scan.angles[[0, 1, -1]]) == pytest.approx([first, second, last])
    assert len(scan.angles) == len(scan.ranges) == n


def test_the_mount_is_the_lasers_pose_seen_from_the_robots(read):
    (scan,), _ = read(flaser(laser="5 7.3 1.7707963267948966", robot="5 7 1.5707963267948966"))
    assert scan.mount == pytest.approx([0.3, 0.0, 0.2])
    assert scan.odometry == pytest.approx([5.0, 7.0, np.pi / 2])


def test_where_the_two_poses_coincide_param_gives_the_mount(read):
    param = [
        "PARAM robot_frontlaser_offset 0.18 nohost 0",
        "PARAM robot_frontlaser_side_offset -0.02 nohost 0",
        "PARAM robot_rearlaser_offset -0.3 nohost 0",
    ]
    (front, rear, told), _ = read(
        *param, flaser(), flaser(word="RLASER"), flaser(laser="0.1 0 0", robot="0 0 0")
    )
    assert front.mount == pytest.approx([0.18, -0.02, 0.0])
    assert rear.mount == pytest.approx([-0.3, 0.0, np.pi])
    assert told.mount == pytest.approx([0.1, 0.0, 0.0])


def test_a_rear_laser_faces_backwards_unless_the_log_says_otherwise(read):
    (silent, by_pose), _ = read(
        flaser(word="RLASER"), flaser(word="RLASER", laser="-0.2 0 3.0", robot="0 0 0")
    )
    assert silent.mount == pytest.approx([0.0, 0.0, np.pi])
    assert by_pose.mount == pytest.approx([-0.2, 0.0, 3.0])
    (by_param,), _ = read(
        "PARAM robot_rearlaser_angular_offset 2.5 nohost 0", flaser(word="RLASER")
    )
    assert by_param.mount == pytest.approx([0.0, 0.0, 2.5])


@pytest.mark.parametrize(("stated", "limit"), [("8.0", 8.0), ("81.91", 45.0), ("0", 45.0)])
def test_a_log_may_state_a_shorter_range(read, stated, limit):
    (front, rear), _ = read(
        f"PARAM robot_front_laser_max {stated} nohost 0", flaser(), flaser(word="RLASER")
    )
    assert front.range_max == limit
    assert rear.range_max == 45.0


def test_a_param_that_must_be_a_number_and_is_none(read):
    with pytest.raises(LogError, match=r"line 2: FLASER: PARAM robot_front_laser_max is 'far'"):
        read("PARAM robot_front_laser_max far nohost 0", flaser())


def test_robotlaser_says_everything_itself(read):
    (scan,), _ = read(robotlaser())
    assert scan.t == 1.5
    assert scan.ranges.tolist() == [1.0, 2.0]
    assert scan.angles.tolist() == [-0.5, -0.25]
    assert scan.range_max == 30.0
    assert scan.mount == pytest.approx([0.2, 0.0, 0.0])
    assert scan.odometry.tolist() == [1.0, 2.0, 0.0]


@pytest.mark.parametrize("values", [{"step": "0"}, {"step": "nan"}, {"start": "inf"}])
def test_robotlaser_with_impossible_beams(read, values):
    with pytest.raises(LogError, match="line 1: ROBOTLASER1: start_angle"):
        read(robotlaser(**values))


def test_odom_is_odometry(read):
    (odometry, _), _ = read("ODOM 1 2 3 0.4 0.5 0.6 7.25 host 0.1", flaser())
    assert isinstance(odometry, Odometry)
    assert odometry.t == 7.25
    assert odometry.pose.tolist() == [1.0, 2.0, 3.0]


def test_comments_are_left_even_where_they_name_messages(read):
    events, skipped = read("# CARMEN FLASER: n r1 … rn", "#FLASER 3", "", flaser())
    assert len(events) == 1
    assert skipped == {}


def test_other_messages_are_skipped_and_counted(read):
    events, skipped = read("SYNC a", flaser(), "NMEA-GGA 1 2 3", "SYNC b")
    assert len(events) == 1
    assert skipped == {"message SYNC": 2, "message NMEA-GGA": 1}


def test_what_is_not_finite_is_skipped_and_counted(read):
    events, skipped = read(
        flaser(robot="nan 0 0"),
        flaser(robot="0 inf 0"),
        flaser(laser="0 0 nan"),
        flaser(0),
        flaser(tail="nan host 1"),
        "ODOM nan 0 0 0 0 0 1 host 1",
        "ODOM 0 0 0 0 0 0 inf host 1",
        flaser(ranges=["nan", "inf", "1.0"]),
    )
    assert len(events) == 1
    assert np.isnan(events[0].ranges[0])
    assert skipped == {
        "odometry not finite": 3,
        "mount not finite": 1,
        "scan without beams": 1,
        "stamp not finite": 2,
    }


WHOLE = {
    "FLASER": flaser(),
    "ROBOTLASER1": robotlaser(),
    "ODOM": f"ODOM 1 2 3 0 0 0 {TAIL}",
}


@pytest.mark.parametrize("word", WHOLE)
@pytest.mark.parametrize("newline", ["", "\n" + flaser() + "\n"], ids=["at the end", "inside"])
def test_a_cut_line_raises_after_what_came_before_it(tmp_path, word, newline):
    path = tmp_path / "cut.log"
    words = WHOLE[word].split()
    for kept in range(1, len(words)):
        path.write_text(flaser() + "\n" + " ".join(words[:kept]) + newline)
        events = iter(read_log(path))
        assert isinstance(next(events), Scan)
        with pytest.raises(LogError, match=rf"cut\.log, line 2: {word}: .*cut"):
            next(events)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("FLASER -3 0 0 0 0 0 0 1 host 1", "the number of readings cannot be -3"),
        ("FLASER many", "'many'"),
        (flaser().replace("2.0", "2.x", 1), "could not convert string to float: '2.x'"),
        (flaser() + " 1.0", "13 fields expected after the word, 14 found"),
        ("2.0 2.0 2.0", "'2.0' begins no message"),
        ("\x00" * 30, "begins no message"),
    ],
)
def test_a_damaged_line_is_named(read, line, reason):
    with pytest.raises(LogError, match=r"drive\.log, line 2: ") as raised:
        read(flaser(), line)
    assert reason in str(raised.value)
