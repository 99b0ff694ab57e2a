"""Moves against plain NumPy: noise from Draws, composition from geometry."""

import numpy as np
import pytest

from mcloc.draws import Draws, Stream
from mcloc.geometry import between, compose
from mcloc.kernels.odometry import apply_moves, sample_moves, undo_moves, wrapped

ROT1, TRANS, ROT2 = 0.3, 0.8, -0.5
SD = (0.1, 0.05, 0.2)


def drawn_moves(reverse_to=-np.inf, n=60, first=11):
    out = np.empty((3, n))
    counter = (first, int(Stream.MOTION), 4, 1, np.uint64(8))
    sample_moves(out, ROT1, TRANS, ROT2, *SD, reverse_to, *counter, 0, n)
    return out, Draws(8, 4, 1).normal(Stream.MOTION, first, n)


def test_a_move_is_rotate_drive_rotate():
    moves, noise = drawn_moves()
    turn, drive, last = ROT1 + SD[0] * noise[0], TRANS + SD[1] * noise[1], ROT2 + SD[2] * noise[2]
    expected = np.stack([drive * np.cos(turn), drive * np.sin(turn), turn + last])
    assert moves == pytest.approx(expected)


def test_a_reversed_move_drives_the_other_way():
    moves, noise = drawn_moves(reverse_to=0.0)
    turn = ROT1 + SD[0] * noise[0]
    drive = np.where(noise[3] < 0.0, -TRANS, TRANS) + SD[1] * noise[1]
    assert moves[0] == pytest.approx(drive * np.cos(turn))
    assert moves[1] == pytest.approx(drive * np.sin(turn))


def test_applied_and_undone_moves_are_those_of_se2():
    rng = np.random.default_rng(1)
    x, moves = rng.uniform(-4.0, 4.0, (2, 3, 60))
    new, old = np.empty((3, 60)), np.empty((3, 60))
    apply_moves(x, moves, new, 0, 60)
    undo_moves(x, moves, old, 0, 60)
    assert np.allclose(new.T, compose(x.T, moves.T))
    turns = moves.T.copy()
    turns[:, 2] = np.arctan2(np.sin(moves[2]), np.cos(moves[2]))
    assert between(old.T, x.T) == pytest.approx(turns)


@pytest.mark.parametrize("angle", [-7.0, -np.pi, -3.0, 0.0, 3.0, np.pi, 50.0])
def test_wrapped_angles_lie_in_the_half_open_circle(angle):
    result = wrapped(angle)
    assert -np.pi < result <= np.pi
    assert np.exp(1j * result) == pytest.approx(np.exp(1j * angle))
