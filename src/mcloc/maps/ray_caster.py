"""Expected ranges: how far each beam of a range finder goes before it meets a wall of the map."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.errors import MapError
from mcloc.geometry import Pose
from mcloc.kernels.cones import PASSABLE, SOLID, UNSEEN, leaps_of
from mcloc.kernels.distance import squared_distance
from mcloc.kernels.field import FOUR
from mcloc.kernels.jit import share
from mcloc.kernels.raycast import lengths, sum_over_rays
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.statespace import States

MOST_CELLS = 250_000_000  # the leaps of all octants are counted in 31 bits
_WORK = 20.0  # ns a ray


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
        beams = np.size(angles)
        out = np.empty(x.shape[1] * beams)

        def run(start: int, stop: int) -> None:
            lengths(*rays, FOUR, out, start, stop)

        share(run, x.shape[1], out.size * _WORK)
        out *= self.grid.resolution
        return out.reshape(x.shape[1], beams)

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
        knots_per_cell = self.grid.resolution / spacing
        padded = np.pad(table, ((0, 0), (0, 1)))
        out = np.empty(x.shape[1])

        def run(start: int, stop: int) -> None:
            sum_over_rays(*rays, padded, knots_per_cell, FOUR, out, start, stop)

        share(run, len(out), len(out) * len(table) * _WORK)
        return out

    def prepare(self) -> None:
        """Make what the first ray needs, once, before several threads ask for it."""
        self._leaps  # noqa: B018

    def farthest(self, range_max: float) -> float:
        """No finite expected range on this map is larger: metres."""
        height, width = self.grid.cells.shape
        return min(range_max, self.grid.resolution * float(np.hypot(height, width)))

    def from_cells(
        self, cells: NDArray[np.intp], directions: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(n · D,): lengths, in cells, of rays from the middle of cells of the map with its ring
        (indices (n,) into them, row by row), in directions (D,) of the map's own frame.
        """
        height, width, *_ = self.frame
        row, column = np.divmod(cells, width)
        x = np.stack([column + 0.5, row + 0.5, np.zeros(len(cells))])
        across = np.stack([np.cos(directions), np.sin(directions)])
        frame = (height, width, 0.0, 0.0, 1.0, 0.0, 1.0)
        out = np.empty(len(cells) * len(directions))

        def run(start: int, stop: int) -> None:
            lengths(x, np.zeros(2), across, self._leaps, frame, np.inf, FOUR, out, start, stop)

        share(run, len(cells), out.size * _WORK)
        return out

    @property
    def frame(self) -> tuple[int, int, float, float, float, float, float]:
        """The map with its ring: height, width, x and y of its corner in the map frame, cos and
        sin of its yaw, cells per m.
        """
        cell = self.grid.resolution
        ox, oy, yaw = self.grid.origin
        height, width = self.grid.cells.shape
        cos, sin = float(np.cos(yaw)), float(np.sin(yaw))
        corner = (float(ox) - cell * (cos - sin), float(oy) - cell * (sin + cos))
        return height + 2, width + 2, *corner, cos, sin, 1.0 / cell

    def _rays(self, x: States, mount: Pose, angles: ArrayLike, range_max: float):  # type: ignore[no-untyped-def]
        """The leading arguments of the kernels."""
        directions = np.asarray(angles, dtype=np.float64) + mount[2]
        return (
            np.ascontiguousarray(x, dtype=np.float64),
            np.ascontiguousarray(mount[:2], dtype=np.float64),
            np.stack([np.cos(directions), np.sin(directions)]),
            self._leaps,
            self.frame,
            range_max / self.grid.resolution,
        )

    @cached_property
    def _leaps(self) -> NDArray[np.uint8]:
        """How far rays may leap, see kernels/cones: 8 bytes a cell."""
        return leaps_of(self.stops)

    @property
    def stops(self) -> NDArray[np.uint8]:
        """(height + 2, width + 2): what each cell is to a ray, see kernels/cones. Raises MapError
        for a map of too many cells.
        """
        walls, passable = self.grid.occupied, self.grid.free
        height, width, *_ = self.frame
        if height * width > MOST_CELLS:
            raise MapError(
                f"{self.grid.name}: {walls.size} cells are more than the {MOST_CELLS} through which"
                " rays can be cast; use a coarser map"
            )
        if self.blur > 0.0 and walls.any():
            near = squared_distance(walls) <= (self.blur / self.grid.resolution) ** 2
            passable = passable | (self.grid.unknown & near)
        blocked = np.where(walls, np.uint8(SOLID), np.uint8(UNSEEN))
        blocked[passable] = PASSABLE
        return np.pad(blocked, 1, constant_values=UNSEEN)
