"""Where a laser sits: along chains of transforms, right way up or not, in one place or none."""

import numpy as np
import pytest

from mcloc.errors import ConfigError, LogError
from mcloc.events import Scan
from mcloc.geometry import compose
from mcloc.io.log import read_log

HALF_TURN_ABOUT_X = (1.0, 0.0, 0.0, 0.0)


def lean(degrees):
    """About y: a laser that looks at the floor ahead."""
    return (0.0, np.sin(np.deg2rad(degrees) / 2), 0.0, np.cos(np.deg2rad(degrees) / 2))


@pytest.fixture
def read(write, ros):
    def read(*script, kind="mcap", **options):
        t = ros.STAMP + 1.0
        return list(read_log(write([*script, ros.odometry(t), ros.scan(t)], kind), **options))

    return read


def test_two_lasers_one_of_them_upside_down(write, ros):
    """The end points of their beams on the robot, by hand.

    Front: at (0.2, 0.1), turned left by 90°. Rear: at (-0.3, 0), facing back and hung upside down,
    so that its left is the robot's left. Beams at -30°, 0° and +30° of 2 m.
    """
    back_and_over = (0.0, 1.0, 0.0, 0.0)  # half a turn about y: x → -x, z → -z, y stays
    beams = {"angle_min": -np.pi / 6, "angle_increment": np.pi / 6}
    script = [
        ros.tf_static(
            ros.transform(0, "base", "front", (0.2, 0.1, 0.3), ros.yaw(np.pi / 2)),
            ros.transform(0, "base", "rear", (-0.3, 0.0, 0.3), back_and_over),
        ),
        ros.odometry(ros.STAMP + 1),
        ros.scan(ros.STAMP + 2, "front", (2.0, 2.0, 2.0), topic="/front", **beams),
        ros.scan(ros.STAMP + 3, "rear", (2.0, 2.0, 2.0), topic="/rear", **beams),
    ]
    _, front, rear = read_log(write(script))
    assert (front.source, rear.source) == ("/front", "/rear")
    side, ahead = 2 * np.sin(np.pi / 6), 2 * np.cos(np.pi / 6)
    by_hand = {
        # a beam at −30° of a laser that faces left ends further ahead on the robot
        "/front": [(0.2 + side, 0.1 + ahead), (0.2, 2.1), (0.2 - side, 0.1 + ahead)],
        # its own −30° is, with its y axis the robot's, 30° to the robot's right
        "/rear": [(-0.3 - ahead, -side), (-2.3, 0.0), (-0.3 - ahead, side)],
    }
    for scan in (front, rear):
        ends = np.stack([2 * np.cos(scan.angles), 2 * np.sin(scan.angles), 0 * scan.angles], -1)
        np.testing.assert_allclose(
            compose(scan.mount, ends)[:, :2], by_hand[scan.source], atol=1e-6
        )


@pytest.mark.parametrize("kind", ["ros1", "sqlite", "mcap"])
def test_a_chain_of_frames_is_composed_in_space(read, ros, kind):
    """A plate hung upside down, and a laser that is upside down on it: the right way up again."""
    _, scan = read(
        ros.tf_static(ros.transform(0, "base", "plate", (0.5, 0.1, 1.0), HALF_TURN_ABOUT_X)),
        ros.tf_static(ros.transform(0, "plate", "laser", (0.1, 0.2, 0.1), HALF_TURN_ABOUT_X)),
        kind=kind,
    )
    assert scan.mount == pytest.approx([0.6, -0.1, 0.0])
    assert scan.angles.tolist() == [-0.5, 0.0, 0.5]


def test_the_base_need_not_be_above_the_laser(read, ros):
    _, scan = read(
        ros.tf_static(
            ros.transform(0, "footprint", "base", (0.1, 0.0, 0.2)),
            ros.transform(0, "footprint", "laser", (0.3, 0.0, 0.2)),
        )
    )
    assert scan.mount == pytest.approx([0.2, 0.0, 0.0])


def test_what_is_not_static_is_read_from_tf_until_it_is_known(read, ros):
    _, scan = read(
        ros.tf_static(ros.transform(0, "plate", "laser", (0.1, 0, 0))),
        ros.tf(ros.transform(1, "odom", "base", (5, 5, 0))),
        ros.tf(ros.transform(1, "base", "plate", (0.2, 0, 0))),
        ros.tf(ros.transform(2, "base", "plate", (9.0, 0, 0))),
    )
    assert scan.mount == pytest.approx([0.3, 0.0, 0.0])


def test_static_transforms_count_before_others(read, ros):
    _, scan = read(
        ros.tf(ros.transform(1, "base", "laser", (9, 0, 0))),
        ros.tf_static(ros.transform(0, "base", "laser", (0.2, 0, 0))),
    )
    assert scan.mount == pytest.approx([0.2, 0.0, 0.0])


def test_slashes_of_the_first_tf_do_not_matter(write, ros):
    script = [
        ros.tf_static(ros.transform(0, "/base", "laser", (0.2, 0, 0))),
        ros.odometry(ros.STAMP, child="base"),
        ros.scan(ros.STAMP, "/laser"),
    ]
    _, scan = read_log(write(script, "ros1"))
    assert scan.mount == pytest.approx([0.2, 0.0, 0.0])


def test_a_scan_in_the_frame_of_the_robot_needs_no_transform(write, ros):
    _, scan = read_log(write([ros.odometry(ros.STAMP), ros.scan(ros.STAMP, "base")]))
    assert scan.mount.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    "transforms",
    [
        [],
        [("base", "elsewhere", (0, 0, 0), (0, 0, 0, 1))],
        [("base", "laser", (0, 0, 0), (0, 0, 0, 0))],
        [("base", "laser", (np.nan, 0, 0), (0, 0, 0, 1))],
        [("laser", "other", (0, 0, 0), (0, 0, 0, 1)), ("other", "laser", (0, 0, 0), (0, 0, 0, 1))],
    ],
    ids=["none", "elsewhere", "no rotation", "nan", "loop"],
)
def test_a_laser_that_stands_nowhere_needs_a_mount(read, ros, transforms):
    script = [ros.tf_static(*(ros.transform(0, *edge) for edge in transforms))]
    with pytest.raises(LogError, match=r"'base' to the frame 'laser' of /scan; .*--mount X,Y,"):
        read(*script)


def test_no_mount_is_taken_through_what_moves(write, ros):
    """An odometry that calls its own frame the robot, of a bag that begins in the midst of a
    drive.
    """
    t = ros.STAMP + 1
    script = [
        ros.tf_static(ros.transform(0, "base", "laser", (0.2, 0, 0))),
        ros.tf(ros.transform(t, "odom", "base", (5, 5, 0))),
        ros.odometry(t, child="odom"),
        ros.scan(t),
    ]
    with pytest.raises(LogError, match=r"'odom' to the frame 'laser' of /scan; .*--mount X,Y,"):
        read_log(write(script))


def test_of_several_lasers_the_one_that_stands_nowhere_may_be_left_out(write, ros):
    t = ros.STAMP + 1
    names = ("front", "left", "rear")
    mounts = [ros.transform(0, "base", name) for name in names if name != "left"]
    scans = [ros.scan(t, name, topic=f"/{name}") for name in names]
    path = write([ros.tf_static(*mounts), ros.odometry(t), *scans])
    remedy = r"of /left; leave it out with --topic scan=/front --topic scan=/rear$"
    with pytest.raises(LogError, match=remedy):
        read_log(path)
    assert len(list(read_log(path, topics={"scan": ["/front", "/rear"]}))) == 3


def test_frames_without_a_name_are_not_one_frame(write, ros):
    script = [ros.odometry(ros.STAMP, child=""), ros.scan(ros.STAMP, "")]
    with pytest.raises(LogError, match="--mount"):
        read_log(write(script))


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_a_given_mount_needs_no_transform_and_counts_before_one(read, ros, kind):
    _, scan = read(mount=(0.1, 0.2, 0.3), kind=kind)
    assert scan.mount.tolist() == [0.1, 0.2, 0.3]


def test_a_given_mount_is_of_one_laser(write, ros):
    script = [ros.odometry(ros.STAMP)]
    script += [ros.scan(ros.STAMP, name, topic=f"/{name}") for name in ("front", "rear")]
    path = write(script)
    with pytest.raises(ConfigError, match=r"there are 2: /front, /rear; .*--topic scan=/front"):
        read_log(path, mount=(0, 0, 0))
    events = list(read_log(path, mount=(0, 0, 1), topics={"scan": "/rear"}))
    assert [event.source for event in events if isinstance(event, Scan)] == ["/rear"]


@pytest.mark.parametrize(("degrees", "fits"), [(8, True), (12, False), (90, False), (172, True)])
def test_a_laser_may_lean_a_little(read, ros, degrees, fits):
    script = ros.tf_static(ros.transform(0, "base", "laser", (0.2, 0, 0), lean(degrees)))
    if fits:
        _, scan = read(script)
        assert scan.mount == pytest.approx([0.2, 0.0, 0.0 if degrees < 90 else np.pi])
    else:
        with pytest.raises(LogError, match=rf"/scan \(frame 'laser'\) is tilted by {degrees}°"):
            read(script)
