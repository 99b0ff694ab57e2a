"""A number for each cell of a map, looked up and summed at points carried along by poses."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.kernels.field import sum_over_points
from mcloc.kernels.jit import share
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.statespace import States


@dataclass(frozen=True, eq=False)
class CellTable:
    """values: (height + 2 m, width + 2 m), the map's cells and m ≥ 1 rings of cells around them,
    the outermost of which stands for everything beyond.
    """

    grid: OccupancyGrid
    values: NDArray[np.floating]

    def sum(self, x: States, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,): Σ over the points (B, 2), metres in the robot's frame, of the value of the cell
        each lies in.
        """
        (ox, oy, yaw), cell = self.grid.origin, self.grid.resolution
        cos, sin = np.cos(yaw), np.sin(yaw)
        margin = cell * ((self.values.shape[0] - self.grid.cells.shape[0]) // 2)
        corner = (ox - margin * (cos - sin), oy - margin * (sin + cos))
        frame = (*self.values.shape, *corner, cos, sin, 1.0 / cell)
        out = np.empty(x.shape[1])
        flat = np.ascontiguousarray(self.values, dtype=np.float32).ravel()
        in_cells = (points / cell).astype(np.float32)

        def run(start: int, stop: int) -> None:
            sum_over_points(x, in_cells, flat, *frame, out, start, stop)

        share(run, len(out), len(out) * (len(points) + 10))
        return out
