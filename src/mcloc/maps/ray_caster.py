"""Expected ranges: how far each beam of a range finder goes before it meets a wall of the map."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import distance_transform_cdt, distance_transform_edt

from mcloc.geometry import Pose
from mcloc.kernels.jit import share
from mcloc.kernels.raycast import LARGEST_LEAP, UNKNOWN, WALL, lengths, sum_over_rays
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.statespace import States

_WORK = 60  # ~1 ns each, for one ray


@dataclass(frozen=True, eq=False)
class RayCaster:
    """Casts the rays of a range finder through a map, exactly.

    A ray runs through free cells. The first cell that is not free ends it: a wall gives the
    expected range; an unknown cell, or the edge of the map, gives none, since nobody knows what
    stands behind it. A sensor inside a wall measures 0.

    blur: metres. Maps made from scans leave cells in front of their walls undecided: unknown cells
    whose centres are that near to a wall's let rays pass.
    """

    grid: OccupancyGrid
    blur: float = 0.0

    def ranges(
        self, x: States, mount: Pose, angles: ArrayLike, range_max: float
    ) -> NDArray[np.float64]:
        """(n, B): expected ranges in metres, inf where no wall is nearer than range_max, NaN where
        a beam leaves known space before.

        x: (3, n) poses of the robot in the map frame. mount: (3,) of the sensor on the robot.
        angles: (B,) radians in the sensor's frame. range_max: metres.
        """
        rays = self._rays(x, mount, angles, range_max)
        out = np.empty((x.shape[1], len(rays[2])))

        def run(start: int, stop: int) -> None:
            lengths(*rays, out, start, stop)

        share(run, len(out), out.size * _WORK)
        out *= self.grid.resolution
        return out

    def sum(
        self,
        x: States,
        mount: Pose,
        angles: ArrayLike,
        range_max: float,
        table: NDArray[np.float32],
        spacing: float,
    ) -> NDArray[np.float64]:
        """(n,): Σ over the beams of a function of the expected range.

        table: (B, K + 2), a row for each beam: its values at the ranges 0, spacing, 2 spacing …
        (metres, up to `farthest` or more), between which it is linear; then for no wall nearer
        than range_max; then for beams that leave known space.
        """
        rays = self._rays(x, mount, angles, range_max)
        out = np.empty(x.shape[1])

        def run(start: int, stop: int) -> None:
            sum_over_rays(*rays, table, self.grid.resolution / spacing, out, start, stop)

        share(run, len(out), len(out) * len(table) * _WORK)
        return out

    def farthest(self, range_max: float) -> float:
        """No finite expected range on this map is larger: metres."""
        height, width = self.grid.cells.shape
        return min(range_max, self.grid.resolution * float(np.hypot(height, width)))

    def _rays(self, x: States, mount: Pose, angles: ArrayLike, range_max: float):  # type: ignore[no-untyped-def]
        """The leading arguments of the kernels."""
        cell = self.grid.resolution
        ox, oy, yaw = self.grid.origin
        cos, sin = float(np.cos(yaw)), float(np.sin(yaw))
        corner = (float(ox) - cell * (cos - sin), float(oy) - cell * (sin + cos))
        mount = np.ascontiguousarray(mount, dtype=np.float64)
        directions = np.asarray(angles, dtype=np.float64) + mount[2]
        return (
            np.ascontiguousarray(x, dtype=np.float64),
            mount[:2],
            np.stack([np.cos(directions), np.sin(directions)], axis=1),
            self._clear.ravel(),
            *self._clear.shape,
            (*corner, cos, sin, 1.0 / cell),
            range_max / cell,
        )

    @cached_property
    def _clear(self) -> NDArray[np.uint8]:
        """(height + 2, width + 2): how far a ray may leap from each cell, see kernels/raycast."""
        walls = self.grid.occupied
        passable = self.grid.free
        if self.blur > 0.0 and walls.any():
            to_wall = distance_transform_edt(~walls) * self.grid.resolution
            passable = passable | (self.grid.unknown & (to_wall <= self.blur))
        passable, walls = np.pad(passable, 1), np.pad(walls, 1)
        leaps = np.minimum(distance_transform_cdt(passable, "chessboard"), LARGEST_LEAP)
        return np.where(passable, leaps, np.where(walls, WALL, UNKNOWN)).astype(np.uint8)
