"""A number for each cell of a map, looked up and summed at points carried along by poses."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.kernels.field import FOUR, look_up, room_for, sum_over_points
from mcloc.kernels.jit import share
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.statespace import States

STEPS = 65535  # between the least and the largest value


@dataclass(frozen=True, eq=False)
class CellTable:
    """A table over a map's cells, to 16 bits.

    codes: (height + 2 m, width + 2 m) uint16, the map's cells and m ≥ 1 rings of cells around them,
    the outermost of which stands for everything beyond: by how many steps the value is below
    `largest`. What is read is within step / 2 of the value that was meant.
    """

    grid: OccupancyGrid
    codes: NDArray[np.uint16]
    largest: float
    step: float

    @classmethod
    def chosen(
        cls, grid: OccupancyGrid, values: NDArray[np.float64], which: NDArray[np.integer]
    ) -> "CellTable":
        """values: (V,) finite; which: (height + 2 m, width + 2 m), the index of each cell's."""
        largest = float(values.max())
        step = (largest - float(values.min())) / STEPS or 1.0
        code_of = np.rint((largest - values) / step).astype(np.uint16)
        codes = np.empty(which.shape, dtype=np.uint16)

        def run(start: int, stop: int) -> None:
            # NumPy makes wider indices of these: a few rows at a time, which stay in the cache.
            for a in range(start, stop, 16):
                b = min(a + 16, stop)
                np.take(code_of, which[a:b], out=codes[a:b], mode="clip")

        share(run, len(which), 2.0 * which.size)
        return cls(grid, codes, largest, step)

    def summed(self, points: NDArray[np.float64]) -> Callable[[States], NDArray[np.float64]]:
        """x (3, n) -> (n,): Σ over the points (B, 2), metres in the robot's frame, of the value of
        the cell that each lies in when the robot is at x.

        Cells are found in float32: a point within 2⁻²² of the map's size to the border between two
        may be taken for one of the other.
        """
        cell, flat, frame = self.grid.resolution, self.codes.ravel(), self.frame
        # Rounded up to whole vectors of 16; the rest of a loop takes as long as one of them.
        in_cells = np.zeros((2, -(-len(points) // 16) * 16), dtype=np.float32)
        in_cells[:, : len(points)] = points.T / cell
        most = self.largest * len(points)

        def summed(x: States) -> NDArray[np.float64]:
            out = np.empty(x.shape[1])

            def run(start: int, stop: int) -> None:
                room = room_for(in_cells.shape[1])
                sum_over_points(
                    x, in_cells, len(points), flat, frame, FOUR, *room, out, start, stop
                )

            share(run, len(out), len(out) * (2.0 + 0.6 * len(points)))
            out *= -self.step
            out += most
            return out

        return summed

    def at(self, x: States) -> NDArray[np.float64]:
        """(n,): the value of the cell that each place x (3, n) lies in."""
        flat, frame = self.codes.ravel(), self.frame
        out = np.empty(x.shape[1])

        def run(start: int, stop: int) -> None:
            look_up(x, flat, frame, room_for(1)[1], out, start, stop)

        share(run, len(out), 2.0 * len(out))
        out *= -self.step
        out += self.largest
        return out

    @cached_property
    def frame(self) -> tuple[int, int, float, float, float, float, float]:
        """Of the table, as the kernels take it."""
        (ox, oy, yaw), cell = self.grid.origin, self.grid.resolution
        cos, sin = float(np.cos(yaw)), float(np.sin(yaw))
        height, width = self.codes.shape
        margin = cell * ((height - self.grid.cells.shape[0]) // 2)
        corner = (float(ox) - margin * (cos - sin), float(oy) - margin * (sin + cos))
        return height, width, *corner, cos, sin, 1.0 / cell
