"""Moves against plain NumPy: noise from Draws, composition from geometry, arcs from the book."""

import numpy as np
import pytest

from mcloc.draws import Draws, Stream
from mcloc.geometry import compose, wrap
from mcloc.kernels.moves import arc_moves, odometry_moves, omnidirectional_moves
from mcloc.kernels.normals import room

FIRST, SECOND, THIRD = 0.3, 0.8, -0.5
SD = (0.1, 0.05, 0.2)


def moved(kernel, x, numbers=(FIRST, SECOND, THIRD, *SD), reverse_below=-np.inf, back=0.0):
    """x (3, N) moved, or where it was before."""
    out = np.empty(x.shape)
    counter = (11, int(Stream.MOTION), 4, 1, np.uint64(8))
    kernel(x, out, numbers, reverse_below, back, counter, *room(), 0, x.shape[1])
    return out


def drawn_moves(kernel, *numbers, **more):
    """(3, 60) moves, which is where they lead from 0; and the (4, 60) normals that they are of."""
    moves = moved(kernel, np.zeros((3, 60)), *numbers, **more)
    return moves, Draws(8, 4, 1).normal(Stream.MOTION, 11, 60)


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


KERNELS = odometry_moves, omnidirectional_moves, arc_moves


@pytest.mark.parametrize("kernel", KERNELS)
def test_moves_are_composed_with_poses(kernel):
    x = np.random.default_rng(1).uniform(-4.0, 4.0, (3, 600))  # more than lie in the cache at once
    moves = moved(kernel, np.zeros((3, 600)))
    error = moved(kernel, x).T - compose(x.T, moves.T)
    error[:, 2] = wrap(error[:, 2])
    assert np.abs(error).max() < 1e-14


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_move_undone_leads_back(kernel):
    x = np.random.default_rng(2).uniform(-3.0, 3.0, (3, 600))
    for reverse_below in (-np.inf, 0.0):
        there = moved(kernel, x, reverse_below=reverse_below)
        back = moved(kernel, there, reverse_below=reverse_below, back=1.0)
        assert back == pytest.approx(x, abs=1e-14)


@pytest.mark.parametrize("kernel", KERNELS)
def test_any_split_gives_the_same_bits(kernel):
    x = np.random.default_rng(3).uniform(-3.0, 3.0, (3, 700))
    counter = (11, int(Stream.MOTION), 4, 1, np.uint64(8))
    split = np.empty(x.shape)
    for start, stop in ((0, 1), (1, 300), (300, 700)):
        kernel(x, split, (FIRST, SECOND, THIRD, *SD), -np.inf, 0.0, counter, *room(), start, stop)
    assert np.array_equal(moved(kernel, x), split)
