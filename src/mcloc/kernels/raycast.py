"""The length of a ray up to the first wall, from cell border to cell border  [Amanatides, Woo: A
fast voxel traversal algorithm for ray tracing, Eurographics 1987], with leaps through open space.

A cell of `clear` holds how far a ray may leap from it: n for a free cell that is the middle of a
square of (2 n − 1)² free cells. The ray goes on from where it leaves that square, so its length is
as exact as it is cell by cell.
"""

import numpy as np

from mcloc.kernels.jit import kernel

WALL = 0
UNKNOWN = 255
LARGEST_LEAP = 254

_LEAST = 1e-300  # of a direction; below, its reciprocal is no number to go on with


@kernel
def cast(x, y, dx, dy, clear, height, width, limit):  # type: ignore[no-untyped-def]
    """Length of a ray from (x, y) along the unit vector (dx, dy), in cells; inf where no wall is
    nearer than the limit, NaN where the ray leaves known space before.

    clear: (height · width,) uint8; its outermost ring is UNKNOWN.
    """
    if not (0.0 <= x < width and 0.0 <= y < height):
        return np.nan
    column, row = int(x), int(y)
    to_right, to_top = dx > -_LEAST, dy > -_LEAST
    step_x, step_y = 1 if to_right else -1, 1 if to_top else -1
    # From a cell's index to the border that the ray leaves it by, measured from the start.
    border_x = (0.0 if to_right else 1.0) - x
    border_y = (0.0 if to_top else 1.0) - y
    per_x = 1.0 / dx if abs(dx) > _LEAST else np.inf
    per_y = 1.0 / dy if abs(dy) > _LEAST else np.inf
    length = 0.0
    while True:
        leap = int(clear[row * width + column])
        if leap == WALL:
            return length
        if leap == UNKNOWN:
            return np.nan
        next_column, next_row = column + step_x * leap, row + step_y * leap
        length_x = (next_column + border_x) * per_x
        length_y = (next_row + border_y) * per_y
        length = max(length, min(length_x, length_y))  # rounding must not lead back
        if length >= limit:
            return np.inf
        # The other coordinate stays in the square, between here and its last cell, come rounding
        # what may.
        if length_x <= length_y:
            column = next_column
            if leap > 1:
                at, last = int(y + length * dy), next_row - step_y
                row = min(max(at, row), last) if to_top else max(min(at, row), last)
        else:
            row = next_row
            if leap > 1:
                at, last = int(x + length * dx), next_column - step_x
                column = min(max(at, column), last) if to_right else max(min(at, column), last)


@kernel
def _sensor(state, offset, frame):  # type: ignore[no-untyped-def]
    """x, y of a sensor in the cells of a map, and cos, sin of the robot's heading on it.

    state: x, y, θ of the robot; offset: x, y of the sensor on it, m. frame: x, y of the map's
    corner, cos and sin of its yaw, cells per m.
    """
    corner_x, corner_y, cos0, sin0, per_cell = frame
    c, s = np.cos(state[2]), np.sin(state[2])
    dx = state[0] + c * offset[0] - s * offset[1] - corner_x
    dy = state[1] + s * offset[0] + c * offset[1] - corner_y
    x = (cos0 * dx + sin0 * dy) * per_cell
    y = (cos0 * dy - sin0 * dx) * per_cell
    return x, y, c * cos0 + s * sin0, s * cos0 - c * sin0


@kernel
def lengths(  # type: ignore[no-untyped-def]
    states, offset, directions, clear, height, width, frame, limit, out, start, stop
):
    """out (N, B): length of every ray of every pose, in cells. directions: (B, 2) unit vectors in
    the robot's frame.
    """
    for i in range(start, stop):
        x, y, cos, sin = _sensor(states[:, i], offset, frame)
        for b in range(directions.shape[0]):
            dx = cos * directions[b, 0] - sin * directions[b, 1]
            dy = sin * directions[b, 0] + cos * directions[b, 1]
            out[i, b] = cast(x, y, dx, dy, clear, height, width, limit)


@kernel
def sum_over_rays(  # type: ignore[no-untyped-def]
    states,
    offset,
    directions,
    clear,
    height,
    width,
    frame,
    limit,
    table,
    knots_per_cell,
    out,
    start,
    stop,
):
    """out (N,): Σ over the rays of table[ray, length], linear between the knots.

    table: (B, K + 2) float32: at K lengths, knots 1 / knots_per_cell cells apart from 0 on and up
    to the limit or farther; then where no wall is nearer than the limit; then where the ray leaves
    known space.
    """
    beyond = table.shape[1] - 2
    unknown = beyond + 1
    for i in range(start, stop):
        x, y, cos, sin = _sensor(states[:, i], offset, frame)
        total = 0.0
        for b in range(directions.shape[0]):
            dx = cos * directions[b, 0] - sin * directions[b, 1]
            dy = sin * directions[b, 0] + cos * directions[b, 1]
            length = cast(x, y, dx, dy, clear, height, width, limit)
            if np.isnan(length):
                total += table[b, unknown]
            elif length == np.inf:
                total += table[b, beyond]
            else:
                at = length * knots_per_cell
                knot = min(int(at), beyond - 2)
                here, there = table[b, knot], table[b, knot + 1]
                total += here + (at - knot) * (there - here)
        out[i] = total
