"""What a perfect range finder measures: the exact distance to the first wall on each beam.

Beams go from cell border to cell border  [Amanatides & Woo 1987], all of them at once and in plain
NumPy: simulated scans owe nothing to the sensor models that they are to test.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.maps.occupancy import OccupancyGrid


def ranges(
    grid: OccupancyGrid, sensor_poses: ArrayLike, angles: ArrayLike, range_max: float
) -> NDArray[np.float64]:
    """(N, B) metres from each sensor to the first occupied cell, inf where none is within reach.

    sensor_poses: (N, 3) in the map frame. angles: (B,) radians in the sensor's frame. range_max:
    metres; a wall at or beyond it gives no return. Unknown cells and what lies outside the grid do
    not stop a beam. A sensor inside a wall measures 0.
    """
    poses = np.atleast_2d(grid.to_grid(sensor_poses))
    angle = poses[:, 2, None] + np.asarray(angles, dtype=np.float64)
    direction = np.stack([np.cos(angle), np.sin(angle)])
    start = np.broadcast_to(poses[:, :2].T[:, :, None] / grid.resolution, direction.shape)
    cells = _cells_to_wall(
        grid.occupied,
        start.reshape(2, -1),
        direction.reshape(2, -1),
        range_max / grid.resolution,
    )
    return cells.reshape(angle.shape) * grid.resolution


def _cells_to_wall(
    walls: NDArray[np.bool_],
    start: NDArray[np.float64],
    direction: NDArray[np.float64],
    limit: float,
) -> NDArray[np.float64]:
    """(R,) length of each ray to a wall, in cells, inf from the limit on; the rays: (2, R)."""
    height, width = walls.shape
    padded = np.pad(walls, 1)
    cell = np.floor(start).astype(np.intp)
    step = np.where(direction < 0.0, -1, 1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        stride = np.abs(1.0 / direction)  # between two borders of the same axis
        border = np.where(direction == 0.0, np.inf, (cell + (step > 0) - start) / direction)

    length = np.full(start.shape[1], np.inf)
    rays = np.arange(start.shape[1])
    travelled = np.zeros(start.shape[1])
    while rays.size:
        hit = padded[np.clip(cell[1], -1, height) + 1, np.clip(cell[0], -1, width) + 1]
        length[rays[hit]] = travelled[hit]
        going = ~hit & (border.min(axis=0) < limit)
        rays, cell, step = rays[going], cell[:, going], step[:, going]
        stride, border = stride[:, going], border[:, going]
        crossed = border.argmin(axis=0), np.arange(rays.size)
        travelled = border[crossed]
        cell[crossed] += step[crossed]
        border[crossed] += stride[crossed]
    return length
