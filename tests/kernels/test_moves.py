"""Moves against plain NumPy: noise from Draws, composition from geometry, arcs from the book."""

import numpy as np
import pytest

from mcloc.draws import Draws, Stream
from mcloc.geometry import between, compose
from mcloc.kernels.moves import (
    apply_moves,
    arc_moves,
    odometry_moves,
    omnidirectional_moves,
    undo_moves,
)

FIRST, SECOND, THIRD = 0.3, 0.8, -0.5
SD = (0.1, 0.05, 0.2)


def drawn_moves(kernel, numbers=(FIRST, SECOND, THIRD, *SD), reverse_below=-np.inf):
    """(3, 60) moves, and the (4, 60) normals that they are made of."""
    out = np.empty((3, 60))
    counter = (11, int(Stream.MOTION), 4, 1, np.uint64(8))
    kernel(out, *numbers, reverse_below, counter, 60)
    return out, Draws(8, 4, 1).normal(Stream.MOTION, 11, 60)


@pytest.mark.parametrize("reverse_below", [-np.inf, 0.0])
def test_a_move_is_rotate_drive_rotate(reverse_below):
    moves, noise = drawn_moves(odometry_moves, reverse_below=reverse_below)
    turn, last = FIRST + SD[0] * noise[0], THIRD + SD[2] * noise[2]
    drive = np.where(noise[3] < reverse_below, -SECOND, SECOND) + SD[1] * noise[1]
    expected = np.stack([drive * np.cos(turn), drive * np.sin(turn), turn + last])
    assert moves == pytest.approx(expected)


@pytest.mark.parametrize("reverse_below", [-np.inf, 0.0])
def test_a_move_is_along_and_across_and_around(reverse_below):
    moves, noise = drawn_moves(omnidirectional_moves, reverse_below=reverse_below)
    along = np.where(noise[3] < reverse_below, -SECOND, SECOND) + SD[0] * noise[0]
    across = SD[1] * noise[1]
    expected = (along + 1j * across) * np.exp(1j * FIRST)
    assert moves[0] + 1j * moves[1] == pytest.approx(expected)
    assert moves[2] == pytest.approx(THIRD + SD[2] * noise[2])


@pytest.mark.parametrize("reverse_below", [-np.inf, 0.0])
def test_a_move_is_an_arc_and_a_last_rotation(reverse_below):
    """Probabilistic Robotics, Table 5.3, from the pose 0 with Δt = 1: x' = (v̂/ω̂) sin ω̂, y' =
    (v̂/ω̂) (1 − cos ω̂), θ' = ω̂ + γ̂.
    """
    moves, noise = drawn_moves(arc_moves, reverse_below=reverse_below)
    v = np.where(noise[3] < reverse_below, -FIRST, FIRST) + SD[0] * noise[0]
    omega = SECOND + SD[1] * noise[1]
    expected = np.stack(
        [
            v / omega * np.sin(omega),
            v / omega * (1.0 - np.cos(omega)),
            omega + THIRD + SD[2] * noise[2],
        ]
    )
    assert moves == pytest.approx(expected)


@pytest.mark.parametrize("turn", [0.0, 1e-300, 1e-9])
def test_an_arc_that_hardly_turns_is_a_line(turn):
    moves, noise = drawn_moves(arc_moves, (0.7, turn, 0.2, 0.1, 0.0, 0.0))
    assert moves[0] == pytest.approx(0.7 + 0.1 * noise[0])
    assert moves[1] == pytest.approx(0.5 * turn * moves[0], rel=1e-6)
    assert moves[2] == pytest.approx(0.2)


def test_an_arc_of_no_length_turns_on_the_spot():
    moves, _ = drawn_moves(arc_moves, (0.0, 1.4, 0.0, 0.0, 0.1, 0.0))
    assert np.abs(moves[:2]).max() == 0.0


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
