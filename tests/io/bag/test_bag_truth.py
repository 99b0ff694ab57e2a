"""Reference poses on a topic."""

import numpy as np
import pytest

from mcloc.errors import ConfigError, LogError, TruthError
from mcloc.io.bag_truth import read_truth


@pytest.fixture
def reference(ros):
    """reference(type, (t, x), …) → script."""

    def reference(kind, *poses, frame="map"):
        script = []
        for t, x in poses:
            header, pose = ros.header(t, frame), ros.pose(x, 2.0, ros.yaw(0.5))
            fields = {
                "PoseStamped": {"header": header, "pose": pose},
                "PoseWithCovarianceStamped": {
                    "header": header,
                    "pose": {"pose": pose, "covariance": np.zeros(36)},
                },
                "TransformStamped": ros.transform(t, frame, "base", (x, 2.0, 0), ros.yaw(0.5)),
            }
            if kind == "Odometry":
                script.append(ros.odometry(t, x, 2.0, 0.5, "/truth", frame))
            else:
                script.append(("/truth", f"geometry_msgs/msg/{kind}", fields[kind]))
        return script

    return reference


@pytest.mark.parametrize("ros_kind", ["ros1", "sqlite", "mcap", "independent zstd"])
@pytest.mark.parametrize(
    "message", ["PoseStamped", "PoseWithCovarianceStamped", "Odometry", "TransformStamped"]
)
def test_the_types_of_a_reference(write, reference, message, ros_kind):
    found = read_truth(write(reference(message, (1.0, 5.0), (2.0, 6.0)), ros_kind), "truth")
    assert found.t.tolist() == [1.0, 2.0]
    np.testing.assert_allclose(found.poses, [[5.0, 2.0, 0.5], [6.0, 2.0, 0.5]])


def test_stamps_increase_as_in_a_trajectory_from_a_file(write, reference):
    poses = [(2.0, 5.0), (1.0, 6.0), (2.0, 7.0), (0.0, 8.0), (3.0, 9.0)]
    found = read_truth(write(reference("PoseStamped", *poses)), "/truth")
    assert found.t.tolist() == [1.0, 2.0, 3.0]  # the pose whose stamp was never set is left out
    assert found.poses[:, 0].tolist() == [6.0, 5.0, 9.0]


@pytest.mark.parametrize("x", [np.nan, np.inf, 1e12])
def test_a_pose_that_cannot_be_right(write, reference, x):
    with pytest.raises(TruthError, match=r"drive, /truth: the pose at 2\.0+ s"):
        read_truth(write(reference("PoseStamped", (1.0, 5.0), (2.0, x))), "/truth")


@pytest.mark.parametrize("frame", ["odom", "/odom", "robot_1/odom"])
@pytest.mark.parametrize("message", ["PoseStamped", "Odometry", "TransformStamped"])
def test_poses_in_the_odometrys_frame_are_no_reference(write, reference, message, frame):
    path = write(reference(message, (1.0, 5.0), frame=frame))
    with pytest.raises(
        TruthError, match=r"/truth: is in the frame '(robot_1/)?odom', not the map's"
    ):
        read_truth(path, "/truth")


def test_what_holds_no_reference(write, ros, reference, tmp_path):
    path = write([*reference("PoseStamped", (0.0, 1.0)), ros.scan(1.0)])
    with pytest.raises(TruthError, match="no pose with a stamp"):
        read_truth(path, "/truth")
    with pytest.raises(ConfigError, match="no topic '/pose'"):
        read_truth(path, "/pose")
    with pytest.raises(ConfigError, match="/scan is sensor_msgs/LaserScan, not geometry_msgs/Pos"):
        read_truth(path, "/scan")
    (tmp_path / "truth.csv").write_text("t,x,y,theta\n0,1,2,3\n")
    with pytest.raises(LogError, match="not a ROS bag"):
        read_truth(tmp_path / "truth.csv", "/truth")
