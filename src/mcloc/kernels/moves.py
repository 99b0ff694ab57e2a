"""x_t = x_{t−1} ⊕ move, the moves of each motion model drawn with their random numbers inside."""

import numpy as np

from mcloc.kernels.jit import kernel
from mcloc.kernels.philox import normal_pair, philox


@kernel
def wrapped(angle):  # type: ignore[no-untyped-def]
    """The same angle in (−π, π]."""
    inside = np.pi - (np.pi - angle) % (2.0 * np.pi)
    return np.pi if inside <= -np.pi else inside


@kernel
def four_normals(i, first, stream, step, part, key):  # type: ignore[no-untyped-def]
    """Those of particle first + i."""
    a, b, c, d = philox(first + i, stream, step, part, key)
    n0, n1 = normal_pair(a, b)
    n2, n3 = normal_pair(c, d)
    return n0, n1, n2, n3


@kernel
def odometry_moves(  # type: ignore[no-untyped-def]
    out, rot1, trans, rot2, sd_rot1, sd_trans, sd_rot2, reverse_below, counter, start, stop
):
    """out (3, N): moves (dx, dy, dθ) in the robot's frame: rotate, drive, rotate, each with its
    noise.

    The drive is reversed where a fourth normal falls below `reverse_below`.
    """
    for i in range(start, stop):
        n0, n1, n2, n3 = four_normals(i, *counter)
        turn = rot1 + sd_rot1 * n0
        length = (-trans if n3 < reverse_below else trans) + sd_trans * n1
        out[0, i] = length * np.cos(turn)
        out[1, i] = length * np.sin(turn)
        out[2, i] = turn + rot2 + sd_rot2 * n2


@kernel
def omnidirectional_moves(  # type: ignore[no-untyped-def]
    out, bearing, trans, rot, sd_trans, sd_strafe, sd_rot, reverse_below, counter, start, stop
):
    """out (3, N): moves (dx, dy, dθ) in the robot's frame: along the bearing, across it, rotated,
    each with its noise.
    """
    cos, sin = np.cos(bearing), np.sin(bearing)
    for i in range(start, stop):
        n0, n1, n2, n3 = four_normals(i, *counter)
        along = (-trans if n3 < reverse_below else trans) + sd_trans * n0
        across = sd_strafe * n1
        out[0, i] = along * cos - across * sin
        out[1, i] = along * sin + across * cos
        out[2, i] = rot + sd_rot * n2


@kernel
def arc_moves(  # type: ignore[no-untyped-def]
    out, length, turn, last, sd_length, sd_turn, sd_last, reverse_below, counter, start, stop
):
    """out (3, N): moves (dx, dy, dθ) in the robot's frame: an arc that begins along x, and a last
    rotation, each with its noise.

    The chord of an arc is sin(φ/2) / (φ/2) as long and leads off at φ/2, which needs no radius.
    """
    for i in range(start, stop):
        n0, n1, n2, n3 = four_normals(i, *counter)
        way = (-length if n3 < reverse_below else length) + sd_length * n0
        turned = turn + sd_turn * n1
        half = 0.5 * turned
        chord = way if half == 0.0 else way * np.sin(half) / half
        out[0, i] = chord * np.cos(half)
        out[1, i] = chord * np.sin(half)
        out[2, i] = turned + last + sd_last * n2


@kernel
def apply_moves(x, moves, out, start, stop):  # type: ignore[no-untyped-def]
    """out = x ⊕ move, column by column; all (3, N)."""
    for i in range(start, stop):
        cos, sin = np.cos(x[2, i]), np.sin(x[2, i])
        out[0, i] = x[0, i] + cos * moves[0, i] - sin * moves[1, i]
        out[1, i] = x[1, i] + sin * moves[0, i] + cos * moves[1, i]
        out[2, i] = wrapped(x[2, i] + moves[2, i])


@kernel
def undo_moves(x, moves, out, start, stop):  # type: ignore[no-untyped-def]
    """out such that out ⊕ move = x, column by column; all (3, N)."""
    for i in range(start, stop):
        theta = x[2, i] - moves[2, i]
        cos, sin = np.cos(theta), np.sin(theta)
        out[0, i] = x[0, i] - cos * moves[0, i] + sin * moves[1, i]
        out[1, i] = x[1, i] - sin * moves[0, i] - cos * moves[1, i]
        out[2, i] = wrapped(theta)
