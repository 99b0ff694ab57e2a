"""The beam model as one would first write it with Numba: from cell to cell by Bresenham's algorithm
[Bresenham: Algorithm for computer control of a digital plotter, IBM Systems Journal 4, 1965].
"""

import numba
import numpy as np


@numba.njit(cache=True)
def expected_range(stops, x0, y0, x1, y1):
    """Cells from (x0, y0) to the first cell on the line to (x1, y1) that stops a ray, and what it
    is: 0 for none, 1 for a wall, 2 for an unknown one.
    """
    height, width = stops.shape
    dx, dy = abs(x1 - x0), abs(y1 - y0)
    step_x, step_y = (1 if x1 > x0 else -1), (1 if y1 > y0 else -1)
    error, x, y = dx - dy, x0, y0
    while True:
        if x < 0 or y < 0 or x >= width or y >= height:
            return np.hypot(x - x0, y - y0), 2
        if stops[y, x] != 0:
            return np.hypot(x - x0, y - y0), stops[y, x]
        if x == x1 and y == y1:
            return np.hypot(x - x0, y - y0), 0
        doubled = 2 * error
        if doubled > -dy:
            error -= dy
            x += step_x
        if doubled < dx:
            error += dx
            y += step_y


@numba.njit(cache=True)
def log_likelihood(states, angles, stops, corner_x, corner_y, resolution, reach, table, spacing):
    """(N,): Σ over the beams of table (B, K + 2) at the nearest of K knots; then none, unknown."""
    out = np.zeros(states.shape[1])
    knots = table.shape[1] - 2
    for i in range(states.shape[1]):
        x, y, theta = states[0, i], states[1, i], states[2, i]
        x0, y0 = int((x - corner_x) / resolution), int((y - corner_y) / resolution)
        for b in range(len(angles)):
            x1 = int(np.floor((x + reach * np.cos(theta + angles[b]) - corner_x) / resolution))
            y1 = int(np.floor((y + reach * np.sin(theta + angles[b]) - corner_y) / resolution))
            cells, what = expected_range(stops, x0, y0, x1, y1)
            if what == 1:
                out[i] += table[b, min(int(cells * resolution / spacing + 0.5), knots - 1)]
            else:
                out[i] += table[b, knots + (what == 2)]
    return out
