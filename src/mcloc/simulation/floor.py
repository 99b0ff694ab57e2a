"""A floor plan drawn with boxes and discs, in metres from the floor's lower left corner."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from mcloc.errors import ConfigError
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

MARGIN = 0.5  # m of unknown around the floor
WALL = 0.15  # m
COARSEST = 0.1  # m a cell; walls of coarser ones get holes


class Box(NamedTuple):
    """A rectangle along the axes, in metres."""

    left: float
    bottom: float
    right: float
    top: float

    def grown(self, by: float) -> "Box":
        """With `by` metres more on each side."""
        return Box(self.left - by, self.bottom - by, self.right + by, self.top + by)

    def place(self, width: float, height: float, rng: np.random.Generator) -> "Box":
        """A box of this size somewhere within."""
        left = self.left + rng.random() * (self.right - self.left - width)
        bottom = self.bottom + rng.random() * (self.top - self.bottom - height)
        return Box(left, bottom, left + width, bottom + height)


class Floor:
    """A block of wall, width × depth metres, out of which rooms are cut.

    resolution: metres a cell. Raises ConfigError where walls would get holes.
    """

    def __init__(self, width: float, depth: float, resolution: float) -> None:
        if not 0.0 < resolution <= COARSEST:
            raise ConfigError(f"resolution must be in (0, {COARSEST}] m/cell, got {resolution}")
        self.resolution = resolution
        shape = [round((side + 2 * MARGIN) / resolution) for side in (depth, width)]
        self.cells = np.full(shape, UNKNOWN, dtype=np.int8)
        self.fill(Box(0.0, 0.0, width, depth), OCCUPIED)

    def fill(self, box: Box, value: int) -> None:
        """Make all of a box FREE or OCCUPIED."""
        self._part(box)[:] = value

    def column(self, x: float, y: float, radius: float) -> None:
        """A round pillar."""
        around = self._part(Box(x - radius, y - radius, x + radius, y + radius))
        rows, columns = np.indices(around.shape)
        centre = (np.array(around.shape) - 1) / 2
        off = np.hypot(rows - centre[0], columns - centre[1]) * self.resolution
        around[off <= radius] = OCCUPIED

    def is_free(self, box: Box) -> bool:
        """Whether nothing stands in a box."""
        return bool((self._part(box) == FREE).all())

    def grid(self, name: str) -> OccupancyGrid:
        """The map, its origin such that the floor's corner is (0, 0).

        As in a map that a robot made, only surfaces are occupied: nobody looked into the walls.
        """
        seen = binary_dilation(self.cells == FREE, np.ones((3, 3), dtype=np.bool_))
        cells = np.where(seen, self.cells, UNKNOWN).astype(np.int8)
        return OccupancyGrid(cells, self.resolution, np.array([-MARGIN, -MARGIN, 0.0]), name=name)

    def _part(self, box: Box) -> NDArray[np.int8]:
        """The cells of a box, as far as it lies within the map, to be written to."""
        left, bottom, right, top = (max(0, round((v + MARGIN) / self.resolution)) for v in box)
        return self.cells[bottom:top, left:right]
