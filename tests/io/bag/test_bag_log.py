"""Which topics are read, what becomes of their messages, and what is left out and counted."""

import numpy as np
import pytest

from mcloc.density import FAR
from mcloc.errors import ConfigError, LogError
from mcloc.events import Odometry, Scan
from mcloc.io.log import read_log, read_odometry


@pytest.fixture
def read(write):
    def read(script, **options):
        log = read_log(write(script), **options)
        return list(log), log.skipped

    return read


@pytest.fixture
def choice(ros):
    """Two lasers, one of them filtered too; two odometries; topics of other types."""
    t = ros.STAMP + 1.0
    return [
        ros.tf_static(
            ros.transform(0, "base", "front"), ros.transform(0, "base", "rear", (-1, 0, 0))
        ),
        ros.tf(ros.transform(t, "odom", "base", (7, 0, 0))),
        ros.odometry(t, 1.0),
        ros.odometry(t, 2.0, topic="/fused"),
        ros.scan(t, "front"),
        ros.scan(t, "front", topic="/scan_filtered"),
        ros.scan(t, "rear", topic="/rear"),
        ("/chatter", "std_msgs/msg/String", {"data": "hello"}),
    ]


def sources(events):
    return [event.source for event in events if isinstance(event, Scan)]


def test_one_laser_on_two_topics_is_a_choice(write, choice):
    says = (
        r"/scan and /scan_filtered are scans of one laser \(frame 'front'\); .*--topic scan=/scan"
    )
    path = write(choice)
    with pytest.raises(ConfigError, match=says):
        read_log(path, topics={"odometry": "/odom"})
    both = {"scan": ["/scan", "/scan_filtered"], "odometry": "/odom"}
    with pytest.raises(ConfigError, match="one laser"):
        read_log(path, topics=both)


def test_a_topic_that_holds_nothing_is_no_laser(write, choice):
    one = [c for c in choice if c[0] not in ("/scan", "/scan_filtered", "/fused")]
    path = write([*one, ("/silent", "sensor_msgs/msg/LaserScan", None)])
    assert sources(read_log(path)) == ["/rear"]
    with pytest.raises(ConfigError, match="has no topic '/silent'"):
        read_log(path, topics={"scan": "/silent"})


def test_lasers_of_their_own_are_all_read(read, choice):
    events, _ = read([c for c in choice if c[0] not in ("/scan_filtered", "/fused")])
    assert sources(events) == ["/scan", "/rear"]
    assert [e.mount[0] for e in events if isinstance(e, Scan)] == [0.0, -1.0]


def test_topics_may_be_chosen_with_or_without_their_slash(write, choice):
    path = write(choice)
    for topics in (
        {"scan": "rear", "odometry": "fused"},
        {"scan": ["/rear"], "odometry": "/fused"},
    ):
        events = list(read_log(path, topics=topics))
        assert sources(events) == ["/rear"]
        assert [e.pose[0] for e in events if isinstance(e, Odometry)] == [2.0]
    twice = {"scan": ["scan", "/scan"], "odometry": ["odom"]}
    assert sources(read_log(path, topics=twice)) == ["/scan"]


def test_several_odometries_are_a_choice(read, choice):
    with pytest.raises(ConfigError, match=r"/odom, /fused; .* --topic odometry=/odom$"):
        read(choice, topics={"scan": "/rear"})


def test_of_odometries_with_other_names_the_shortest_is_proposed(read, ros):
    names = ("/robot/gt_odom", "/robot/odom", "/robot/odom_filtered")
    script = [ros.odometry(ros.STAMP + 1, topic=name) for name in names]
    with pytest.raises(ConfigError, match=r"odometry=/robot/odom$"):
        read([*script, ros.scan(ros.STAMP + 1, "base")])


@pytest.mark.parametrize(
    ("topics", "reason"),
    [
        ({"scan": "/laser"}, r"no topic '/laser'; .*/chatter \(std_msgs/String\), .*/scan \("),
        ({"scan": "/chatter"}, "/chatter is std_msgs/String, not sensor_msgs/LaserScan; .*/rear"),
        ({"odometry": "/scan"}, "/scan is sensor_msgs/LaserScan, not nav_msgs/Odometry"),
        ({"odometry": ["/odom", "/fused"]}, "one topic, got /odom, /fused"),
        ({"scans": "/scan"}, "role 'scans' of a topic; did you mean 'scan'"),
    ],
)
def test_topics_that_cannot_be(read, choice, topics, reason):
    with pytest.raises(ConfigError, match=reason):
        read(choice, topics={"scan": "/rear", "odometry": "/odom"} | topics)


def test_topics_are_of_bags(tmp_path):
    path = tmp_path / "drive.log"
    path.write_text("FLASER 1 2.0 0 0 0 0 0 0 1.0 host 1.0\n")
    with pytest.raises(ConfigError, match="topics are of ROS bags; this is CARMEN"):
        read_log(path, topics={"scan": "/scan"})
    assert len(list(read_log(path, topics={}))) == 1


@pytest.mark.parametrize("kind", ["ros1", "sqlite", "mcap"])
@pytest.mark.parametrize("topics", [None, {"odometry": "/tf"}])
def test_without_an_odometry_topic_tf_tells_it(write, ros, kind, topics):
    t = ros.STAMP
    script = [ros.odometry(t, 9.0)] if topics else []
    script += [
        ros.tf_static(ros.transform(0, "base", "laser", (0.2, 0, 0))),
        ros.tf(
            ros.transform(t + 9, "map", "odom", (5, 5, 0)),
            ros.transform(t + 1, "/odom", "base", (1, 2, 0), ros.yaw(0.5)),
        ),
        ros.scan(t + 1.5),
        ros.tf(
            ros.transform(t + 2, "odom", "base", (3, 4, 0)), ros.transform(t + 2, "odom", "mark")
        ),
    ]
    first, scan, last = read_log(write(script, kind), topics=topics)
    assert (first.t - t, scan.t - t, last.t - t) == (1.0, 1.5, 2.0)
    assert first.pose == pytest.approx([1.0, 2.0, 0.5])
    assert last.pose == pytest.approx([3.0, 4.0, 0.0])
    assert scan.mount == pytest.approx([0.2, 0.0, 0.0])


@pytest.mark.parametrize("order", [1, -1])
def test_the_robot_is_the_frame_that_leads_to_a_laser(write, ros, order):
    """Goals and charging stations hang on odom, too, in the same message or before the robot."""
    t = ros.STAMP + 1
    moving = [
        ros.transform(t, "odom", "goal", (9, 9, 0)),
        ros.transform(t, "odom", "base", (1, 2, 0), ros.yaw(0.5)),
    ][::order]
    mount = ros.transform(t, "base", "laser", (0.2, 0, 0))
    for name, script in {
        "static": [ros.tf(*moving), ros.tf_static(mount)],
        "one": [ros.tf(*moving, mount)],
        "each": [ros.tf(moving[0]), ros.tf(moving[1]), ros.tf(mount)],
    }.items():
        odometry, scan = read_log(write([*script, ros.scan(t)], name=name))
        assert odometry.pose == pytest.approx([1.0, 2.0, 0.5])
        assert scan.mount == pytest.approx([0.2, 0.0, 0.0])


def test_the_old_tf_of_ros_1_is_tf_too(write, ros):
    t = ros.STAMP
    tf = ros.tf(ros.transform(t, "/odom", "/base"), ros.transform(t, "/base", "/laser", (1, 0, 0)))
    script = [("/tf", "tf/msg/tfMessage", tf[2]), ros.scan(t)]
    odometry, scan = read_log(write(script, "ros1"))
    assert odometry.pose.tolist() == [0.0, 0.0, 0.0]
    assert scan.mount.tolist() == [1.0, 0.0, 0.0]


def test_a_bag_whose_tf_has_no_odom_frame(read, ros):
    script = [ros.scan(ros.STAMP), ros.tf(ros.transform(1, "odom_combined", "base"))]
    with pytest.raises(
        LogError, match="from a frame 'odom'; the frames there: base, odom_combined"
    ):
        read(script)


def test_odometry_alone_needs_no_laser(write, ros):
    t = ros.STAMP + 1.0
    moving = {"goal": (7, 7, 0), "base": (9, 9, 0)}
    tf = [ros.tf(ros.transform(t, "odom", name, at)) for name, at in moving.items()]
    mount = ros.tf_static(ros.transform(0, "base", "front"))
    lasers = [ros.scan(t, name, topic=f"/{name}") for name in ("front", "rear")]
    path = write([*tf, mount, ros.odometry(t, 1.0), ros.odometry(t, np.nan), *lasers])
    assert [event.pose[0] for event in read_odometry(path)] == [1.0]
    for topics in ({"odometry": "/tf"}, {"odometry": "tf", "scan": "front"}):
        assert [event.pose[0] for event in read_odometry(path, topics)] == [9.0]
    (event,) = read_odometry(write([ros.odometry(t, 2.0)], name="blind"))
    assert event.pose[0] == 2.0
    with pytest.raises(ConfigError, match="no topic '/odo'"):
        read_odometry(path, {"odometry": "/odo"})


def test_a_bag_without_odometry(read, ros):
    with pytest.raises(LogError, match=r"no odometry, .*its topics: /scan \(sensor_msgs/LaserS"):
        read([ros.scan(ros.STAMP)])


def test_a_bag_without_scans(read, ros):
    with pytest.raises(LogError, match=r"holds no sensor_msgs/LaserScan; its topics: /odom \(nav"):
        read([ros.odometry(ros.STAMP)])


def test_the_poses_of_odometry_are_seen_from_above(read, ros):
    q = 3.0 * np.array(ros.yaw(-2.5))  # not of unit length: a rotation all the same
    (odometry, _), _ = read([ros.odometry(ros.STAMP, 1, -2, q=q), ros.scan(ros.STAMP, "base")])
    assert odometry.pose == pytest.approx([1.0, -2.0, -2.5])


def test_what_cannot_be_used_is_skipped_and_counted(read, ros):
    t = ros.STAMP + 1.0
    raw = b"\x00\x01\x00\x00" + b"\xff" * 40
    events, skipped = read(
        [
            ros.odometry(0.0),
            ros.odometry(t, np.nan),
            ros.odometry(t, q=(0, 0, 0, 0)),
            ros.odometry(t),
            ros.scan(t, "base"),
            ros.scan(0.0, "base"),
            ros.scan(t, "other"),
            ros.scan(t, "base", ranges=()),
            ros.scan(t, "base", angle_increment=0.0),
            ros.scan(t, "base", angle_increment=np.nan),
            ros.scan(t, "base", angle_min=np.inf),
            ros.scan(t, "base", range_max=np.nan),
            ros.scan(t, "base", range_max=0.0),
            ros.scan(t, "base", range_min=9.0),
            ("/scan", "sensor_msgs/msg/LaserScan", raw),
            ("/odom", "nav_msgs/msg/Odometry", b""),
        ]
    )
    assert len(events) == 2
    assert skipped == {
        "stamp not set": 2,
        "odometry not finite": 2,
        "scan of frame 'other' on /scan": 1,
        "scan without beams": 1,
        "scan without angles": 3,
        "scan without range limits": 3,
        "damaged message on /scan": 1,
        "damaged message on /odom": 1,
    }


def test_odometry_beyond_any_map_is_skipped(read, ros):
    t = ros.STAMP + 1.0
    far = [
        ros.odometry(t + k, *at) for k, at in enumerate([(1e300, 0), (0, -FAR), (0.99 * FAR, 0)])
    ]
    events, skipped = read([*far, ros.scan(t, "base")])
    assert [event.pose[0] for event in events if isinstance(event, Odometry)] == [0.99 * FAR]
    assert skipped == {"odometry beyond 1e+07 m": 2}


def test_readings_stay_as_they_are(read, ros):
    ranges = (np.nan, np.inf, -1.0, 0.1, 5.0, 9.0)
    (_, scan), _ = read(
        [ros.odometry(ros.STAMP), ros.scan(ros.STAMP, "base", ranges, range_max=np.inf)]
    )
    np.testing.assert_array_equal(scan.ranges, np.float32(ranges))
    assert scan.angles.tolist() == [-0.5, 0.0, 0.5, 1.0, 1.5, 2.0]  # as many as there are ranges
    assert scan.returned.tolist() == [False, False, False, False, True, True]


def test_one_beam_needs_no_step(read, ros):
    scan = ros.scan(ros.STAMP, "base", (1.0,), angle_increment=0.0)
    (_, scan), _ = read([ros.odometry(ros.STAMP), scan])
    assert scan.angles.tolist() == [-0.5]


def test_a_bag_without_a_return_raises_at_its_end(read, ros):
    with pytest.raises(LogError, match=r"drive: holds no scan with a return"):
        read([ros.odometry(ros.STAMP), ros.scan(ros.STAMP, "base", (0.0, np.inf))])


def test_scans_of_another_definition_are_named(read, ros):
    scan = ("/scan", "sensor_msgs/msg/LaserScan", b"\x00\x01\x00\x00" + b"\x00" * 500)
    with pytest.raises(LogError, match=r"not one message of /scan can be read as sensor_msgs"):
        read([ros.odometry(ros.STAMP), scan])
