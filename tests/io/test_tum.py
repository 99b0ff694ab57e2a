"""Reference and estimated trajectories as text."""

import gzip

import numpy as np
import pytest

from mcloc.errors import ConfigError, TruthError
from mcloc.io.tum import read_trajectory, write_tum
from mcloc.trajectory import Trajectory

ESTIMATES = (
    "t,x,y,theta,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt,n_particles,share,likelihood_fast\n"
    "1.0,2,3,0.5,0.1,0.2,0.3,0.4,0.5,0.6,500,0.9,\n"
    "2.0,2,3,0.5,,,,,,,500,1.0,0.25\n"
)


@pytest.fixture
def write(tmp_path):
    def write(content):
        path = tmp_path / "reference"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


@pytest.mark.parametrize("pack", [bytes, gzip.compress])
def test_csv_by_its_header(write, pack):
    trajectory = read_trajectory(write(pack(b"# by hand\n\ny, t ,theta,x,note\n2,0.5,3.5,1,7\n")))
    assert trajectory.t.tolist() == [0.5]
    assert trajectory.poses[0] == pytest.approx([1.0, 2.0, 3.5 - 2 * np.pi])
    assert trajectory.covariances is None
    assert trajectory.share is None


def test_the_estimates_of_a_run_bring_their_covariances(write):
    trajectory = read_trajectory(write(ESTIMATES))
    assert trajectory.covariances.shape == (2, 3, 3)
    assert trajectory.covariances[0].tolist() == [[0.1, 0.2, 0.3], [0.2, 0.4, 0.5], [0.3, 0.5, 0.6]]
    assert np.isnan(trajectory.covariances[1]).all()
    assert trajectory.share.tolist() == [0.9, 1.0]


def test_tum_takes_yaw_from_any_quaternion(write):
    # yaw 0.6 alone, of norm 2; then the same after a roll of 0.3
    half, roll = 0.3, 0.15
    tilted = np.array([np.sin(roll) * np.cos(half), np.sin(roll) * np.sin(half)])
    upright = np.array([np.cos(roll) * np.sin(half), np.cos(roll) * np.cos(half)])
    trajectory = read_trajectory(
        write(
            f"# t x y z qx qy qz qw\n0 1 2 9 0 0 {2 * np.sin(half)} {2 * np.cos(half)}\n"
            f"1 3 4 9 {tilted[0]} {tilted[1]} {upright[0]} {upright[1]}\n"
        )
    )
    assert trajectory.poses == pytest.approx(np.array([[1, 2, 0.6], [3, 4, 0.6]]))


def test_poses_out_of_order_are_sorted_and_doubles_left(write):
    trajectory = read_trajectory(write("t,x,y,theta\n3,3,0,0\n1,1,0,0\n3,9,0,0\n2,2,0,0\n"))
    assert trajectory.t.tolist() == [1.0, 2.0, 3.0]
    assert trajectory.poses[:, 0].tolist() == [1.0, 2.0, 3.0]


def test_a_written_trajectory_is_read_as_it_was(tmp_path):
    t = np.array([1e9 + 0.25, 1e9 + 0.5, 1e9 + 1.0])
    poses = np.array([[1.5, -2.0, 3.1], [0.0, 0.0, -3.1], [1e-3, 5.0, 0.0]])
    path = tmp_path / "trajectory.tum"
    write_tum(Trajectory(t, poses), path)
    trajectory = read_trajectory(path)
    assert trajectory.t == pytest.approx(t, abs=1e-6, rel=0)
    assert trajectory.poses == pytest.approx(poses, abs=1e-6)


def test_where_nothing_can_be_written(tmp_path):
    with pytest.raises(ConfigError, match="cannot be written"):
        write_tum(Trajectory(np.zeros(1), np.zeros((1, 3))), tmp_path / "missing" / "a.tum")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("", "holds no poses"),
        ("# only a comment\n", "holds no poses"),
        ("t,x,y,theta\n", "no poses"),
        ("t,x,y\n1,2,3\n", "line 1: the header lacks theta"),
        ("0,1,2,3\n1,2,3,4\n", "line 1: the header lacks t, x, y, theta"),
        ("t,x,y,theta\n1,2,3,4\n2,2\n", "line 3: 4 fields expected, 2 found"),
        ("t,x,y,theta\n1,2,south,4\n", "line 2: .*'south'"),
        ("t,x,y,theta\n\n1,2,3,4\n2,nan,3,4\n", "line 4: stamp and pose must be finite"),
        ("t,x,y,theta\n,2,3,4\n", "line 2: stamp and pose must be finite"),
        ("1 2 3 4\n", "line 1: 8 fields expected, 4 found"),
        ("0 1 2 0 0 0 0 1\n1 1 2 0 0 0 0 0\n", "line 2: the quaternion"),
        ("0 1 2 0 0 0 nan 1\n", "line 1: the quaternion"),
        ("1 inf 2 0 0 0 0 1\n", "line 1: stamp and pose must be finite"),
        (b"\x89PNG\r\n\x1a\n\x00", "fields expected"),
        (gzip.compress(b"t,x,y,theta\n1,2,3,4\n", mtime=0)[:-12], "cut or damaged"),
    ],
)
def test_what_cannot_be_used_is_named(write, content, reason):
    with pytest.raises(TruthError, match=f"reference.*{reason}"):
        read_trajectory(write(content))


def test_what_is_no_file(tmp_path):
    for path in (tmp_path, tmp_path / "missing.csv"):
        with pytest.raises(TruthError, match=str(path)):
            read_trajectory(path)


def test_a_pose_beyond_the_planet_is_refused(tmp_path):
    path = tmp_path / "far.csv"
    path.write_text("t,x,y,theta\n0,0,0,0\n1,1e200,0,0\n")
    with pytest.raises(TruthError, match=r"far\.csv, line 3: x and y must be below"):
        read_trajectory(path)
