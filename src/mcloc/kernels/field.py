"""Σ_beams log p(r | x) from a table over the cells of a map: the loop of the likelihood field and
its like.

The table holds how far log p falls short of its largest value, in whole steps of 16 bits. Whole
numbers add up to the same sum in any order, and half the memory of float32 stays in the cache.
"""

import numpy as np
from numpy.typing import NDArray

from mcloc.kernels.elementary import sincos
from mcloc.kernels.jit import fused, kernel, scalar

_TOGETHER = 256  # particles whose sines are taken at once
_X, _Y, _COS, _SIN = range(0, 4 * _TOGETHER, _TOGETHER)

_BATCH = 8
"""Particles whose cells are found before any is looked up: what was stored as a vector of 16 cannot
be read one by one before it has reached the cache (0.48 instead of 0.53 ns a particle and beam)."""

FOUR = np.uint64(4)
"""Lookups that are on their way at a time.

An argument of the kernel, not a constant in it: of a loop whose pace it knows the compiler makes
gathers, which take twice as long on the processors of AMD (1.0 instead of 0.5 ns for a particle
and beam, all in all).
"""


@kernel
def sum_over_points(states, points, beams, table, frame, four, pose, cells, out, start, stop):  # type: ignore[no-untyped-def]
    """out (N,): the sum of table[cell of endpoint] over the beams.

    points (2, ≥ beams): endpoints in the robot's frame, float32, in cells. table: (height · width,)
    uint16; its outermost ring stands for everything off the map. frame: height, width, x, y of the
    table's corner in the map frame, m, cos and sin of its yaw, cells per m. pose, cells: from
    `room_for`.
    """
    height, width, corner_x, corner_y, cos0, sin0, per_cell = frame
    right, top = np.float32(width - 0.5), np.float32(height - 0.5)
    row_length = np.int32(width)
    padded = points.shape[1]
    points_x, points_y = points[0], points[1]
    for first in range(start, stop, _TOGETHER):
        count = _TOGETHER if stop - first > _TOGETHER else stop - first
        x, y, theta = states[0, first:stop], states[1, first:stop], states[2, first:stop]
        for i in range(count):
            dx, dy = x[i] - corner_x, y[i] - corner_y
            s, c = sincos(theta[i])
            pose[_X + i] = np.float32((cos0 * dx + sin0 * dy) * per_cell)
            pose[_Y + i] = np.float32((cos0 * dy - sin0 * dx) * per_cell)
            pose[_COS + i] = np.float32(c * cos0 + s * sin0)
            pose[_SIN + i] = np.float32(s * cos0 - c * sin0)
        for batch in range(0, count, _BATCH):
            size = _BATCH if count - batch > _BATCH else count - batch
            for j in range(size):
                of = cells[j * padded : (j + 1) * padded]
                _cells_of_points(pose, batch + j, points_x, points_y, right, top, row_length, of)
            for j in range(size):
                begin, n = np.uint64(j * padded), np.uint64(beams)
                out[first + batch + j] = _sum_of(table, cells, begin, n, four)


@kernel
def look_up(states, table, frame, cells, out, start, stop):  # type: ignore[no-untyped-def]
    """out (N,): table[cell of the place]; everything as for `sum_over_points`, in a quarter of the
    time that one point at the origin takes there.
    """
    height, width, corner_x, corner_y, cos0, sin0, per_cell = frame
    right, top, row_length = width - 0.5, height - 0.5, np.int32(width)
    for first in range(start, stop, _TOGETHER):
        x, y = states[0, first:stop], states[1, first:stop]
        count = _TOGETHER if stop - first > _TOGETHER else stop - first
        for i in range(count):
            dx, dy = x[i] - corner_x, y[i] - corner_y
            column, row = (cos0 * dx + sin0 * dy) * per_cell, (cos0 * dy - sin0 * dx) * per_cell
            column, row = (column if column > 0.0 else 0.0), (row if row > 0.0 else 0.0)
            column, row = (column if column < right else right), (row if row < top else top)
            cells[i] = np.uint32(np.int32(row) * row_length + np.int32(column))
        for i in range(count):
            out[first + i] = table[np.uint64(cells[i])]


def room_for(beams: int) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """What a kernel here needs for itself; each allocation in it takes 0.05 s to compile."""
    return np.empty(4 * _TOGETHER, np.float32), np.empty(_BATCH * max(beams, 32), np.uint32)


@fused
def _cells_of_points(pose, i, points_x, points_y, right, top, row_length, cells):  # type: ignore[no-untyped-def]
    """cells (B,): where the points lie in the table, those off the map on its ring.

    Limits instead of branches, and a loop of its own: 16 beams at once, 0.2 ns a beam.
    """
    x, y, cos, sin = pose[_X + i], pose[_Y + i], pose[_COS + i], pose[_SIN + i]
    for b in range(len(cells)):
        column = x + cos * points_x[b] - sin * points_y[b]
        row = y + sin * points_x[b] + cos * points_y[b]
        column = column if column > np.float32(0.0) else np.float32(0.0)
        row = row if row > np.float32(0.0) else np.float32(0.0)
        column = column if column < right else right
        row = row if row < top else top
        cells[b] = np.uint32(np.int32(row) * row_length + np.int32(column))


@scalar
def _sum_of(table, cells, first, n, four):  # type: ignore[no-untyped-def]
    """Σ table[cells], four sums at a time. Unsigned indices need no look at their sign."""
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    s0, s1, s2, s3 = np.uint64(0), np.uint64(0), np.uint64(0), np.uint64(0)
    b, stop = first, first + n
    while b + three < stop:
        s0 += np.uint64(table[np.uint64(cells[b])])
        s1 += np.uint64(table[np.uint64(cells[b + one])])
        s2 += np.uint64(table[np.uint64(cells[b + two])])
        s3 += np.uint64(table[np.uint64(cells[b + three])])
        b += four
    while b < stop:
        s0 += np.uint64(table[np.uint64(cells[b])])
        b += one
    return np.float64(s0 + s1 + s2 + s3)
