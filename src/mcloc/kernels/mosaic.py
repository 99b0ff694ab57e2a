"""Brightness of a ceiling above poses: one place each, or a patch that turns along, compared with
an image.

A table holds the mosaic row by row, with a ring of NaN around it. Between the middles of four
pixels brightness is bilinear; it is NaN where one of the four is.
"""

import numpy as np

from mcloc.kernels.elementary import sincos
from mcloc.kernels.jit import kernel, scalar


@kernel
def look_up_brightness(places, table, frame, out, start, stop):  # type: ignore[no-untyped-def]
    """out (N,): brightness at the places (≥ 2, N) in metres, map frame.

    table: (height · width,) float32. frame: height, width, x, y of the table's corner in the map
    frame, m, cos and sin of its yaw, pixels per m.
    """
    height, width, corner_x, corner_y, cos0, sin0, per_pixel = frame
    for i in range(start, stop):
        dx, dy = places[0, i] - corner_x, places[1, i] - corner_y
        column = (cos0 * dx + sin0 * dy) * per_pixel - 0.5
        row = (cos0 * dy - sin0 * dx) * per_pixel - 0.5
        out[i] = _between(table, height, width, column, row)


@kernel
def match_patch(states, points, pattern, table, frame, dots, squares, start, stop):  # type: ignore[no-untyped-def]
    """dots (N,): Σ_k v_k d_k; squares (N,): Σ_k d_k². d_k is how much brighter the mosaic is at
    point k than at the known ones in the mean, and 0 at those that are unknown.

    states: (3, N) poses. points: (2, P) metres, robot frame. pattern: (P,) v, their mean 0. table,
    frame: as for `look_up_brightness`.
    """
    height, width, corner_x, corner_y, cos0, sin0, per_pixel = frame
    for i in range(start, stop):
        dx, dy = states[0, i] - corner_x, states[1, i] - corner_y
        sin1, cos1 = sincos(states[2, i])
        column0 = (cos0 * dx + sin0 * dy) * per_pixel - 0.5
        row0 = (cos0 * dy - sin0 * dx) * per_pixel - 0.5
        c = (cos1 * cos0 + sin1 * sin0) * per_pixel
        s = (sin1 * cos0 - cos1 * sin0) * per_pixel
        known, total, square, dot, weight = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(len(pattern)):
            column = column0 + c * points[0, k] - s * points[1, k]
            row = row0 + s * points[0, k] + c * points[1, k]
            m, v = _between(table, height, width, column, row), pattern[k]
            if m == m:
                known += 1.0
                total += m
                square += m * m
                dot += v * m
                weight += v
        mean = total / known if known > 0.0 else 0.0
        dots[i] = dot - mean * weight
        left = square - mean * total
        squares[i] = left if left > 0.0 else 0.0


@scalar
def _between(table, height, width, column, row):  # type: ignore[no-untyped-def]
    """Brightness at a place in pixels from the middle of the first one; limits instead of branches
    keep what is off the table, and NaN, on its ring.
    """
    right, top = width - 1.000001, height - 1.000001
    column = column if column > 0.0 else 0.0
    row = row if row > 0.0 else 0.0
    column = column if column < right else right
    row = row if row < top else top
    i, j = np.int64(column), np.int64(row)
    a, b = column - i, row - j
    at = np.uint64(j * width + i)
    above = np.uint64(at + np.uint64(width))
    one = np.uint64(1)
    low = table[at] + a * (table[at + one] - table[at])
    high = table[above] + a * (table[above + one] - table[above])
    return low + b * (high - low)
