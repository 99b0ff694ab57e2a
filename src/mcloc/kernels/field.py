"""Σ_beams log p(r | x) from a table over the cells of a map: the loop of the likelihood field and
its like.
"""

import numpy as np

from mcloc.kernels.jit import kernel


@kernel
def sum_over_points(  # type: ignore[no-untyped-def]
    states, points, table, height, width, origin_x, origin_y, cos0, sin0, per_cell, out, start, stop
):
    """out (N,): the sum of table[cell of endpoint] over the beams.

    points (B, 2): endpoints in the robot's frame, in cells. table: (height · width,) float32; its
    outermost ring stands for everything off the map. origin: of the table's corner in the map
    frame, m; cos0, sin0: its yaw; per_cell: 1/m.
    """
    for i in range(start, stop):
        dx, dy = states[0, i] - origin_x, states[1, i] - origin_y
        x = np.float32((cos0 * dx + sin0 * dy) * per_cell)
        y = np.float32((cos0 * dy - sin0 * dx) * per_cell)
        c, s = np.cos(states[2, i]), np.sin(states[2, i])
        cos = np.float32(c * cos0 + s * sin0)
        sin = np.float32(s * cos0 - c * sin0)
        total = 0.0
        for b in range(points.shape[0]):
            column = int(np.floor(x + cos * points[b, 0] - sin * points[b, 1]))
            row = int(np.floor(y + sin * points[b, 0] + cos * points[b, 1]))
            column = min(max(column, 0), width - 1)
            row = min(max(row, 0), height - 1)
            total += table[row * width + column]
        out[i] = total
