"""Path, against the same by NumPy over all poses at once."""

import numpy as np
import pytest

from mcloc.geometry import between
from mcloc.inspection.path import Path


def path_of(poses: np.ndarray) -> Path:
    path = Path()
    for pose in poses:
        path.add(pose)
    return path


def test_of_nothing() -> None:
    assert (path_of(np.zeros((0, 3))).length, Path().extent) == (0.0, 0.0)


def test_lengths_and_extent() -> None:
    rng = np.random.default_rng(1)
    poses = np.cumsum(rng.normal(0.0, 0.3, (200, 3)), axis=0)
    path = path_of(poses)
    moves = between(poses[:-1], poses[1:])
    assert path.count == 200
    assert path.length == pytest.approx(np.hypot(moves[:, 0], moves[:, 1]).sum())
    assert path.forward == pytest.approx(moves[:, 0].clip(min=0.0).sum())
    assert path.backward == pytest.approx(-moves[:, 0].clip(max=0.0).sum())
    assert path.length < 100.0
    assert path.extent == pytest.approx(np.hypot(*np.ptp(poses[:, :2], axis=0)))


def test_the_extent_is_that_of_a_piece_of_the_way() -> None:
    straight = np.zeros((1001, 3))
    straight[:, 0] = np.arange(1001.0)
    assert path_of(straight).extent == pytest.approx(100.0, abs=1.0)
