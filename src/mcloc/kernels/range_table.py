"""Σ_beams log p(z | e), with e looked up in a table of expected ranges: [cell][angle].

The rays of one pose then read one row of the table, a few lines of the cache.
"""

import numpy as np

from mcloc.kernels.elementary import sincos
from mcloc.kernels.jit import kernel, scalar

_TOGETHER = 256  # poses whose sines are taken at once
_BATCH = 8  # poses whose indices are found before any is looked up: 0.6 instead of 0.85 ns a ray

NOT_KNOWN = 0
"""What the table says where a ray leaves known space; e in steps, plus 1, everywhere else."""


@kernel
def fill_rows(lengths, steps_per_cell, table):  # type: ignore[no-untyped-def]
    """table (n,) uint16: the nearest step to each length (n,) in cells, NaN for what is not known.

    The lengths must be less than 65535 steps.
    """
    for i in range(len(table)):
        step = np.floor(lengths[i] * steps_per_cell + 1.5)
        table[i] = np.uint16(step) if step == step else np.uint16(NOT_KNOWN)


@kernel
def sum_over_table(  # type: ignore[no-untyped-def]
    states, offset, turns, beams, row_of, table, angles, log_p, which, frame, four, out, start, stop
):
    """out (N,): Σ over the beams of log_p[beam, e].

    offset: x, y of the sensor on the robot, m. turns: (≥ beams,) float32, direction of each beam in
    the robot's frame, in steps of 2π / angles, from 0 to below angles. row_of: (height · width,)
    int32, which row of the table belongs to a cell of the map with its ring. table: (rows ·
    angles,). log_p: flat, and which (B,) uint64: where in it the values of each beam begin: where e
    is not known, then at 0, 1 … steps, up to the most that the table holds; not to have to look
    for an end is a tenth of the time.
    frame: height, width, x, y of the corner in the map frame, m, cos and sin of the map's yaw, the
    yaw, cells per m.
    """
    height, width, corner_x, corner_y, cos0, sin0, yaw, per_cell = frame
    offset_x, offset_y, row_length = offset[0], offset[1], np.int32(width)
    per_angle, around = angles / (2.0 * np.pi), np.float32(angles)
    padded = len(turns)
    cell, heading = np.empty(_TOGETHER, np.int32), np.empty(_TOGETHER, np.float32)
    index = np.empty(_BATCH * padded, np.uint32)
    for first in range(start, stop, _TOGETHER):
        count = min(_TOGETHER, stop - first)
        x, y, theta = states[0, first:stop], states[1, first:stop], states[2, first:stop]
        for i in range(count):
            s, c = sincos(theta[i])
            dx = x[i] + c * offset_x - s * offset_y - corner_x
            dy = y[i] + s * offset_x + c * offset_y - corner_y
            column, row = (cos0 * dx + sin0 * dy) * per_cell, (cos0 * dy - sin0 * dx) * per_cell
            inside = (column >= 0.0) & (column < width) & (row >= 0.0) & (row < height)
            column, row = (column if inside else 0.0), (row if inside else 0.0)
            cell[i] = np.int32(row) * row_length + np.int32(column)
            turn = (theta[i] - yaw) * per_angle + 0.5
            turn = turn - angles * np.floor(turn / angles)
            sound = (turn >= 0.0) & (turn < angles)  # not of a heading that is no number
            heading[i] = np.float32(turn if sound else 0.0)
        for batch in range(0, count, _BATCH):
            size = min(_BATCH, count - batch)
            for j in range(size):
                row_start = np.uint32(row_of[np.uint64(cell[batch + j])] * angles)
                here = index[j * padded : (j + 1) * padded]
                _index_of_angles(turns, heading[batch + j], around, row_start, here)
            for j in range(size):
                begin, n = np.uint64(j * padded), np.uint64(beams)
                out[first + batch + j] = _sum_of(index, begin, table, log_p, which, n, four)


@scalar
def _index_of_angles(turns, heading, around, first, index):  # type: ignore[no-untyped-def]
    """index (B,): where in the table each beam's range stands. A loop of its own: 16 at once."""
    for b in range(len(turns)):
        turn = heading + turns[b]
        turn = turn - around if turn >= around else turn
        turn = turn if turn < around else np.float32(0.0)  # a sum may be rounded up to the circle
        index[b] = first + np.uint32(np.int32(turn))


@scalar
def _sum_of(index, first, table, log_p, which, n, four):  # type: ignore[no-untyped-def]
    """Σ log_p, four sums at a time; why `four` is an argument is told in kernels/field."""
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    b = np.uint64(0)
    while b + three < n:
        at = first + b
        s0 += log_p[which[b] + np.uint64(table[np.uint64(index[at])])]
        s1 += log_p[which[b + one] + np.uint64(table[np.uint64(index[at + one])])]
        s2 += log_p[which[b + two] + np.uint64(table[np.uint64(index[at + two])])]
        s3 += log_p[which[b + three] + np.uint64(table[np.uint64(index[at + three])])]
        b += four
    while b < n:
        s0 += log_p[which[b] + np.uint64(table[np.uint64(index[first + b])])]
        b += one
    return (s0 + s1) + (s2 + s3)
