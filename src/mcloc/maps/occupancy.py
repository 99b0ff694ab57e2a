"""OccupancyGrid: free, occupied and unknown cells, and where they lie in the map frame."""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.errors import MapError
from mcloc.geometry import Pose, Poses, between, compose

UNKNOWN = -1
FREE = 0
OCCUPIED = 100

LEAST_CELL, LARGEST_CELL = 1e-3, 100.0  # m; beyond, a unit is wrong
FARTHEST = 1e7  # m; no northing of UTM is larger


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """A map of square cells.

    cells: (height, width) int8, row 0 lowest in y, column 0 lowest in x (of the grid's own frame):
    the chance of being occupied in percent, 0 … 100, or −1 for unknown. resolution: metres a cell.
    origin: (3,) pose of the outer corner of cell (0, 0) in the map frame; its θ turns the grid. A
    cell is occupied from `occupied_thresh` on, free up to `free_thresh`, and otherwise unknown;
    unknown cells are neither free nor walls.
    """

    cells: NDArray[np.int8]
    resolution: float
    origin: Pose
    occupied_thresh: float = 0.65
    free_thresh: float = 0.196
    name: str = "map"

    def __post_init__(self) -> None:
        cells = np.ascontiguousarray(self.cells, dtype=np.int8)
        origin = np.array(self.origin, dtype=np.float64)
        if cells.ndim != 2 or cells.size == 0:
            raise MapError(
                f"{self.name}: cells must be a table of height × width, got {cells.shape}"
            )
        if not LEAST_CELL <= self.resolution <= LARGEST_CELL:
            raise MapError(
                f"{self.name}: resolution must be from {LEAST_CELL} to {LARGEST_CELL} m/cell, "
                f"got {self.resolution}"
            )
        if origin.shape != (3,) or not np.isfinite(origin).all():
            raise MapError(f"{self.name}: origin must be [x, y, yaw], got {self.origin}")
        if not (np.abs(origin[:2]) < FARTHEST).all():
            raise MapError(
                f"{self.name}: origin must be less than {FARTHEST:g} m away, got {origin.tolist()}"
            )
        if not 0.0 <= self.free_thresh < self.occupied_thresh <= 1.0:
            raise MapError(
                f"{self.name}: thresholds must satisfy 0 ≤ free_thresh < occupied_thresh ≤ 1, "
                f"got {self.free_thresh} and {self.occupied_thresh}"
            )
        object.__setattr__(self, "cells", cells)
        object.__setattr__(self, "origin", origin)

    @classmethod
    def load(cls, path: str | Path) -> "OccupancyGrid":
        """The map in a file: ROS map_server YAML with its image, or CMU's wean.dat(.gz)."""
        from mcloc.maps.files import load

        return load(path)

    def save(self, path: str | Path) -> None:
        """Write `path` (YAML) and a PGM image beside it, as ROS map_server writes them."""
        from mcloc.maps.files import save

        save(self, path)

    @cached_property
    def occupied(self) -> NDArray[np.bool_]:
        """(height, width): cells that are walls."""
        return self.cells >= self.occupied_thresh * 100.0

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """(height, width): cells that a robot can stand on."""
        return (self.cells >= 0) & (self.cells <= self.free_thresh * 100.0)

    @cached_property
    def unknown(self) -> NDArray[np.bool_]:
        """(height, width): neither."""
        return ~(self.occupied | self.free)

    @cached_property
    def checksum(self) -> str:
        """SHA-256 of everything but the name."""
        shape = (*self.cells.shape, self.resolution, self.occupied_thresh, self.free_thresh)
        digest = hashlib.sha256(self.cells.tobytes())
        digest.update(np.array([*shape, *self.origin]).tobytes())
        return digest.hexdigest()

    def to_grid(self, poses: ArrayLike) -> Poses:
        """Map frame → grid frame (metres from the corner of cell (0, 0), along its axes)."""
        return between(self.origin, poses)

    def cell_of(self, poses: ArrayLike) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Row and column of each pose (…, 3); may lie outside the grid."""
        grid = self.to_grid(poses)
        return (
            np.floor(grid[..., 1] / self.resolution).astype(np.intp),
            np.floor(grid[..., 0] / self.resolution).astype(np.intp),
        )

    def state_at(self, pose: ArrayLike) -> str:
        """'free', 'occupied', 'unknown' or 'outside' at one pose (3,)."""
        row, column = self.cell_of(pose)
        height, width = self.cells.shape
        if not (0 <= row < height and 0 <= column < width):
            return "outside"
        if self.occupied[row, column]:
            return "occupied"
        return "free" if self.free[row, column] else "unknown"

    def extent(self) -> str:
        """The area covered, for people: the bounding box of the map in its frame."""
        height, width = np.array(self.cells.shape) * self.resolution
        corners = compose(
            self.origin, [[0, 0, 0], [width, 0, 0], [0, height, 0], [width, height, 0]]
        )
        (x0, y0), (x1, y1) = corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)
        return f"x {x0:g} … {x1:g} m, y {y0:g} … {y1:g} m"
