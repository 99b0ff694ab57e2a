"""x_t = x_{t−1} ⊕ move, the moves of each motion model drawn with their random numbers inside."""

from mcloc.kernels.elementary import sincos, wrapped
from mcloc.kernels.jit import kernel, scalar
from mcloc.kernels.philox import normal_pair, philox


@scalar
def four_normals(i, first, stream, step, part, key):  # type: ignore[no-untyped-def]
    """Those of particle first + i."""
    a, b, c, d = philox(first + i, stream, step, part, key)
    n0, n1 = normal_pair(a, b)
    n2, n3 = normal_pair(c, d)
    return n0, n1, n2, n3


@kernel
def odometry_moves(  # type: ignore[no-untyped-def]
    out, rot1, trans, rot2, sd_rot1, sd_trans, sd_rot2, reverse_below, counter, n
):
    """out (3, ≥ n): moves (dx, dy, dθ) in the robot's frame: rotate, drive, rotate, each with its
    noise.

    The drive is reversed where a fourth normal falls below `reverse_below`.
    """
    dx, dy, dtheta = out[0], out[1], out[2]
    for i in range(n):
        n0, n1, n2, n3 = four_normals(i, *counter)
        turn = rot1 + sd_rot1 * n0
        length = (-trans if n3 < reverse_below else trans) + sd_trans * n1
        sin, cos = sincos(turn)
        dx[i] = length * cos
        dy[i] = length * sin
        dtheta[i] = turn + rot2 + sd_rot2 * n2


@kernel
def omnidirectional_moves(  # type: ignore[no-untyped-def]
    out, bearing, trans, rot, sd_trans, sd_strafe, sd_rot, reverse_below, counter, n
):
    """out (3, ≥ n): moves (dx, dy, dθ) in the robot's frame: along the bearing, across it, rotated,
    each with its noise.
    """
    sin, cos = sincos(bearing)
    dx, dy, dtheta = out[0], out[1], out[2]
    for i in range(n):
        n0, n1, n2, n3 = four_normals(i, *counter)
        along = (-trans if n3 < reverse_below else trans) + sd_trans * n0
        across = sd_strafe * n1
        dx[i] = along * cos - across * sin
        dy[i] = along * sin + across * cos
        dtheta[i] = rot + sd_rot * n2


@kernel
def arc_moves(  # type: ignore[no-untyped-def]
    out, length, turn, last, sd_length, sd_turn, sd_last, reverse_below, counter, n
):
    """out (3, ≥ n): moves (dx, dy, dθ) in the robot's frame: an arc that begins along x, and a last
    rotation, each with its noise.

    The chord of an arc is sin(φ/2) / (φ/2) as long and leads off at φ/2, which needs no radius.
    """
    dx, dy, dtheta = out[0], out[1], out[2]
    for i in range(n):
        n0, n1, n2, n3 = four_normals(i, *counter)
        way = (-length if n3 < reverse_below else length) + sd_length * n0
        turned = turn + sd_turn * n1
        half = 0.5 * turned
        sin, cos = sincos(half)
        chord = way if half == 0.0 else way * sin / half
        dx[i] = chord * cos
        dy[i] = chord * sin
        dtheta[i] = turned + last + sd_last * n2


@kernel
def apply_moves(x, moves, out, start, stop):  # type: ignore[no-untyped-def]
    """out = x ⊕ move: x and out (3, N), moves (3, ≥ stop − start)."""
    x0, x1, x2 = x[0, start:stop], x[1, start:stop], x[2, start:stop]
    dx, dy, dtheta = moves[0], moves[1], moves[2]
    out0, out1, out2 = out[0, start:stop], out[1, start:stop], out[2, start:stop]
    for i in range(stop - start):
        sin, cos = sincos(x2[i])
        out0[i] = x0[i] + cos * dx[i] - sin * dy[i]
        out1[i] = x1[i] + sin * dx[i] + cos * dy[i]
        out2[i] = wrapped(x2[i] + dtheta[i])


@kernel
def undo_moves(x, moves, out, start, stop):  # type: ignore[no-untyped-def]
    """out such that out ⊕ move = x: x and out (3, N), moves (3, ≥ stop − start)."""
    x0, x1, x2 = x[0, start:stop], x[1, start:stop], x[2, start:stop]
    dx, dy, dtheta = moves[0], moves[1], moves[2]
    out0, out1, out2 = out[0, start:stop], out[1, start:stop], out[2, start:stop]
    for i in range(stop - start):
        theta = x2[i] - dtheta[i]
        sin, cos = sincos(theta)
        out0[i] = x0[i] - cos * dx[i] + sin * dy[i]
        out1[i] = x1[i] - sin * dx[i] - cos * dy[i]
        out2[i] = wrapped(theta)
