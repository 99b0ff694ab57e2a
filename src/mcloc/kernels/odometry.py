"""x_t ~ p(x_t | u_t, x_{t−1}) of the odometry model, with its random numbers drawn inside."""

import numpy as np

from mcloc.kernels.jit import kernel
from mcloc.kernels.philox import normal_pair, philox


@kernel
def wrapped(angle):  # type: ignore[no-untyped-def]
    """The same angle in (−π, π]."""
    inside = np.pi - (np.pi - angle) % (2.0 * np.pi)
    return np.pi if inside <= -np.pi else inside


@kernel
def sample_moves(  # type: ignore[no-untyped-def]
    out,
    rot1,
    trans,
    rot2,
    sd_rot1,
    sd_trans,
    sd_rot2,
    reverse_below,
    first,
    stream,
    step,
    part,
    key,
    start,
    stop,
):
    """out (3, N): moves (dx, dy, dθ) in the robot's frame: rotate, drive, rotate, each with its
    noise.

    The drive is reversed where a fourth normal falls below `reverse_below`.
    """
    for i in range(start, stop):
        a, b, c, d = philox(first + i, stream, step, part, key)
        n0, n1 = normal_pair(a, b)
        n2, n3 = normal_pair(c, d)
        turn = rot1 + sd_rot1 * n0
        length = (-trans if n3 < reverse_below else trans) + sd_trans * n1
        out[0, i] = length * np.cos(turn)
        out[1, i] = length * np.sin(turn)
        out[2, i] = turn + rot2 + sd_rot2 * n2


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
