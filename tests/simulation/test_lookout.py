"""Landmarks on walls, and when a robot sees them."""

from collections import Counter

import numpy as np
import pytest

from mcloc.geometry import wrap
from mcloc.registry import ParameterError
from mcloc.simulation import Lookout, SimulatedDrive, Spotter
from mcloc.simulation.team_drive import in_sight

SHARP = Spotter(sigma_range=0.0, sigma_bearing=0.0, p_false=0.0, p_seen=1.0, range_max=6.0)


def test_a_landmark_is_seen_where_no_wall_hides_it(drive: SimulatedDrive) -> None:
    lookout, rng = Lookout(landmarks=12, camera=SHARP), np.random.default_rng(2)
    landmarks = lookout.placed(drive.grid, rng)
    assert landmarks.names == tuple(str(number) for number in range(6, 18))
    t, poses = drive.truth.t[::8], drive.truth.poses[::8]
    seen = lookout.look(drive.grid, landmarks, t, poses, rng)
    assert [one.t for one in seen] == sorted(one.t for one in seen)
    assert seen
    expected = Counter[str]()
    for name, place in zip(landmarks.names, landmarks.places, strict=True):
        there = np.tile([*place, 0.0], (len(t), 1))
        off = place - poses[:, :2]
        bearing = wrap(np.arctan2(off[:, 1], off[:, 0]) - poses[:, 2])
        near = (np.hypot(off[:, 0], off[:, 1]) <= 6.0) & (np.abs(bearing) <= np.pi / 2)
        expected[name] = int((near & in_sight(drive.grid, poses, there)).sum())
    assert Counter(one.seen for one in seen) == +expected
    for one in seen:
        x, y, theta = drive.truth.at(np.array([one.t]))[0]
        px, py = landmarks.places[landmarks.names.index(one.seen)]
        assert one.range == pytest.approx(np.hypot(px - x, py - y))
        off = wrap(one.bearing - (np.arctan2(py - y, px - x) - theta))
        assert off == pytest.approx(0.0, abs=1e-9)


def test_without_a_landmark_there_is_nothing_to_see() -> None:
    with pytest.raises(ParameterError, match="landmarks = 0"):
        Lookout(landmarks=0)
