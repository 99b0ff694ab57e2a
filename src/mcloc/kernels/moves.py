"""x_t = x_{t−1} ⊕ move, and x_{t−1} = x_t ⊖ move: the moves of each motion model, drawn with their
random numbers inside.

A move goes `along` a bearing in the robot's frame and `across` it, and turns the robot by dθ:

    x' = x + R(θ + bearing) (along, across),   θ' = θ + dθ

One sine serves the bearing and the heading. To undo a move is to take off the same from the heading
that was before it. words (4, TOGETHER) uint32 and normals (4, TOGETHER) float32 are room for those.
"""

from mcloc.kernels.elementary import sincos, wrapped
from mcloc.kernels.jit import kernel, scalar
from mcloc.kernels.normals import TOGETHER, four_normals


@scalar
def _moved(x, y, theta, bearing, along, across, dtheta, back):  # type: ignore[no-untyped-def]
    """The pose after the move, or before it where back = 1. Factors instead of branches."""
    sign = 1.0 - 2.0 * back
    sin, cos = sincos(theta - back * dtheta + bearing)
    x = x + sign * (along * cos - across * sin)
    y = y + sign * (along * sin + across * cos)
    return x, y, wrapped(theta + sign * dtheta)


@kernel
def odometry_moves(  # type: ignore[no-untyped-def]
    x, out, numbers, reverse_below, back, counter, words, normals, start, stop
):
    """out (3, N): x (3, N) moved: rotate, drive, rotate, each with its noise.

    The drive is reversed where a fourth normal falls below `reverse_below`.
    """
    rot1, trans, rot2, sd_rot1, sd_trans, sd_rot2 = numbers
    first, stream, step, part, key = counter
    n0, n1, n2, n3 = normals[0], normals[1], normals[2], normals[3]
    for a in range(start, stop, TOGETHER):
        b = a + TOGETHER if a + TOGETHER < stop else stop
        four_normals(words, normals, b - a, first + a, stream, step, part, key)
        x0, x1, x2 = x[0, a:b], x[1, a:b], x[2, a:b]
        out0, out1, out2 = out[0, a:b], out[1, a:b], out[2, a:b]
        for i in range(b - a):
            turn = rot1 + sd_rot1 * float(n0[i])
            driven = (-trans if n3[i] < reverse_below else trans) + sd_trans * float(n1[i])
            turned = turn + rot2 + sd_rot2 * float(n2[i])
            pose = _moved(x0[i], x1[i], x2[i], turn, driven, 0.0, turned, back)
            out0[i], out1[i], out2[i] = pose


@kernel
def omnidirectional_moves(  # type: ignore[no-untyped-def]
    x, out, numbers, reverse_below, back, counter, words, normals, start, stop
):
    """out (3, N): x (3, N) moved along a bearing, across it, and rotated, each with its noise."""
    bearing, trans, rot, sd_trans, sd_strafe, sd_rot = numbers
    first, stream, step, part, key = counter
    n0, n1, n2, n3 = normals[0], normals[1], normals[2], normals[3]
    for a in range(start, stop, TOGETHER):
        b = a + TOGETHER if a + TOGETHER < stop else stop
        four_normals(words, normals, b - a, first + a, stream, step, part, key)
        x0, x1, x2 = x[0, a:b], x[1, a:b], x[2, a:b]
        out0, out1, out2 = out[0, a:b], out[1, a:b], out[2, a:b]
        for i in range(b - a):
            along = (-trans if n3[i] < reverse_below else trans) + sd_trans * float(n0[i])
            across, turned = sd_strafe * float(n1[i]), rot + sd_rot * float(n2[i])
            pose = _moved(x0[i], x1[i], x2[i], bearing, along, across, turned, back)
            out0[i], out1[i], out2[i] = pose


@kernel
def arc_moves(  # type: ignore[no-untyped-def]
    x, out, numbers, reverse_below, back, counter, words, normals, start, stop
):
    """out (3, N): x (3, N) moved along an arc, and a last rotation, each with its noise.

    The chord of an arc is sin(φ/2) / (φ/2) as long and leads off at φ/2, which needs no radius.
    """
    length, turn, last, sd_length, sd_turn, sd_last = numbers
    first, stream, step, part, key = counter
    n0, n1, n2, n3 = normals[0], normals[1], normals[2], normals[3]
    for a in range(start, stop, TOGETHER):
        b = a + TOGETHER if a + TOGETHER < stop else stop
        four_normals(words, normals, b - a, first + a, stream, step, part, key)
        x0, x1, x2 = x[0, a:b], x[1, a:b], x[2, a:b]
        out0, out1, out2 = out[0, a:b], out[1, a:b], out[2, a:b]
        for i in range(b - a):
            way = (-length if n3[i] < reverse_below else length) + sd_length * float(n0[i])
            half = 0.5 * (turn + sd_turn * float(n1[i]))
            sin, _ = sincos(half)
            chord = way if half == 0.0 else way * sin / half
            turned = 2.0 * half + last + sd_last * float(n2[i])
            pose = _moved(x0[i], x1[i], x2[i], half, chord, 0.0, turned, back)
            out0[i], out1[i], out2[i] = pose
