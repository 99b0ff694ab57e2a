"""What a perfect range finder measures: the exact distance to the first wall on each beam.

Beams go from cell border to cell border  [Amanatides & Woo 1987], and where walls are far they
leave a whole square of empty cells at once. All is plain NumPy: simulated scans owe nothing to the
sensor models that they are to test.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from mcloc.maps.occupancy import OccupancyGrid

TOGETHER = 1 << 14  # rays; more at a time do not fit the cache


class Hits(NamedTuple):
    """Where rays meet walls.

    length: (R,) metres, inf without a wall. cell: (2, R) column and row. axis: (R,) 0 where the
    wall's surface lies across x of the grid's frame, 1 across y. The last two mean nothing where
    length is 0 or inf.
    """

    length: NDArray[np.float64]
    cell: NDArray[np.intp]
    axis: NDArray[np.intp]


def ranges(
    grid: OccupancyGrid, sensor_poses: ArrayLike, angles: ArrayLike, range_max: float
) -> NDArray[np.float64]:
    """(N, B) metres from each sensor to the first occupied cell, inf where none is within reach.

    sensor_poses: (N, 3) in the map frame. angles: (B,) radians in the sensor's frame. range_max:
    metres; a wall at or beyond it gives no return. Unknown cells and what lies outside the grid do
    not stop a beam. A sensor inside a wall measures 0.
    """
    start, direction = rays(grid, sensor_poses, angles)
    hits = first_walls(grid.occupied, grid.resolution, start, direction, range_max)
    return hits.length.reshape(-1, np.size(angles))


def rays(
    grid: OccupancyGrid, sensor_poses: ArrayLike, angles: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Start and direction, both (2, N · B), of all beams of sensors at the poses (N, 3).

    In the grid's own frame, starts in metres, directions of length 1; beam by beam, then sensor by
    sensor.
    """
    poses = np.atleast_2d(grid.to_grid(sensor_poses))
    angle = poses[:, 2, None] + np.asarray(angles, dtype=np.float64)
    direction = np.stack([np.cos(angle), np.sin(angle)])
    start = np.broadcast_to(poses[:, :2].T[:, :, None], direction.shape)
    return start.reshape(2, -1), direction.reshape(2, -1)


def first_walls(
    walls: NDArray[np.bool_],
    resolution: float,
    start: NDArray[np.float64],
    direction: NDArray[np.float64],
    range_max: float,
) -> Hits:
    """The first cell of `walls` (height, width) on each ray; start, direction: (2, R) as `rays`."""
    n = start.shape[1]
    hits = Hits(np.full(n, np.inf), np.zeros((2, n), np.intp), np.zeros(n, np.intp))
    if walls.any():
        gaps = ndimage.distance_transform_cdt(np.pad(~walls, 1, constant_values=True), "chessboard")
        for first in range(0, n, TOGETHER):
            some = slice(first, first + TOGETHER)
            part = Hits(hits.length[some], hits.cell[:, some], hits.axis[some])
            _cast(
                gaps, start[:, some] / resolution, direction[:, some], range_max / resolution, part
            )
    hits.length[:] *= resolution
    return hits


def _cast(
    gaps: NDArray[np.int32],
    start: NDArray[np.float64],
    direction: NDArray[np.float64],
    limit: float,
    hits: Hits,
) -> None:
    """Fill in the hits of some rays, lengths in cells.

    gaps: how many steps of a king it is from each cell to the next wall, with a border of one cell
    around the grid; all that lies outside has at least the gap of the border's nearest cell.
    """
    height, width = gaps.shape[0] - 2, gaps.shape[1] - 2
    direction = direction + 0.0  # −0 becomes 0: nothing is ever reached against it
    going = np.arange(start.shape[1])
    cell = np.floor(start).astype(np.intp)
    axis = np.zeros(going.size, np.intp)
    travelled = np.zeros(going.size)
    while going.size:
        gap = gaps[np.clip(cell[1], -1, height) + 1, np.clip(cell[0], -1, width) + 1]
        wall = gap == 0
        hit = going[wall]
        hits.length[hit], hits.axis[hit] = travelled[wall], axis[wall]
        hits.cell[:, hit] = cell[:, wall]
        # The square of cells nearer than the gap is empty: out of it at its nearest side.
        forward = direction >= 0.0
        with np.errstate(all="ignore"):  # along an axis, and 0/0 in walls
            sides = (cell + np.where(forward, gap, 1 - gap) - start) / direction
        axis = (sides[1] < sides[0]).astype(np.intp)
        travelled = np.minimum(sides[0], sides[1])
        ahead = ~wall & (travelled < limit)
        going, gap, axis, travelled = going[ahead], gap[ahead], axis[ahead], travelled[ahead]
        start, direction, forward = start[:, ahead], direction[:, ahead], forward[:, ahead]
        before, cell = cell[:, ahead], np.floor(start + travelled * direction).astype(np.intp)
        # On the side that is left, the cell is known; on the other axis rounding may not leave.
        cell = np.clip(cell, before - gap + 1, before + gap - 1)
        out = axis, np.arange(going.size)
        cell[out] = before[out] + np.where(forward[out], gap, -gap)
