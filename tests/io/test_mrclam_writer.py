"""MRCLAM folders are read as they were written."""

from collections import Counter

import numpy as np
import pytest

from mcloc.errors import LogError
from mcloc.events import Detection, Odometry, Sightings
from mcloc.geometry import wrap
from mcloc.io.log import read_log
from mcloc.io.mrclam import Mrclam
from mcloc.io.mrclam_writer import write_mrclam
from mcloc.maps.landmarks import Landmarks
from mcloc.trajectory import Trajectory

LANDMARKS = Landmarks(["6", "12"], np.array([[1.5, -2.0], [-3.25, 4.0]]))
SEEN = [Detection(0.5, "12", 3.5, -0.25), Detection(0.5, "6", 1.0, 0.5), Detection(2.0, "6", 2, 3)]


def arcs() -> Trajectory:
    """Arcs forwards and backwards, a turn on the spot and a rest, from 0."""
    t, pose, poses = 0.25 * np.arange(9.0), np.zeros(3), [np.zeros(3)]
    for length, turn in [(1, 0.5), (2, -3), (-1, 0.7), (0, 2), (0, 0), (0.5, 0), (1, 3), (1, 1e-9)]:
        # By many short straight moves.
        headings = pose[2] + turn * (np.arange(100_000) + 0.5) / 100_000
        along = length * np.exp(1j * headings).mean()
        pose = pose + np.array([along.real, along.imag, turn])
        poses.append(pose)
    table = np.array(poses)
    table[:, 2] = wrap(table[:, 2])
    return Trajectory(t, table)


def test_all_of_it_is_read_again(tmp_path):
    truth = Trajectory(np.array([0.0, 1.0]), np.array([[1.0, 2.0, 3.0], [-1.0, 2.5, -3.0]]))
    write_mrclam(tmp_path / "new", 1, LANDMARKS, arcs(), SEEN, truth)
    events = list(read_log(tmp_path / "new", robot=1))
    odometry = [event for event in events if isinstance(event, Odometry)]
    assert [event.t for event in odometry] == arcs().t.tolist()
    read = np.array([event.pose for event in odometry])
    np.testing.assert_allclose(read[:, :2], arcs().poses[:, :2], atol=1e-5)
    np.testing.assert_allclose(wrap(read[:, 2] - arcs().poses[:, 2]), 0.0, atol=1e-5)
    first, second = (event for event in events if isinstance(event, Sightings))
    assert (first.t, second.t) == (0.5, 2.0)
    assert first.landmark.tolist() == [1, 0]
    assert first.range.tolist() == [3.5, 1.0]
    assert first.bearing.tolist() == [-0.25, 0.5]
    folder = Mrclam(str(tmp_path / "new"), 1)
    assert folder.landmarks.names == LANDMARKS.names
    assert folder.landmarks.places.tolist() == LANDMARKS.places.tolist()
    assert folder.truth is not None
    np.testing.assert_allclose(folder.truth.poses, truth.poses, atol=1e-6)
    skipped = Counter()
    list(folder.events(np.zeros(3), skipped))
    assert not skipped


def test_where_nothing_can_be_written(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(LogError, match="file: cannot be written to"):
        write_mrclam(tmp_path / "file", 1, LANDMARKS, arcs(), SEEN, arcs())
