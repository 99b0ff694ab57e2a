"""Glass: a beam that meets it at the angle i comes back with the chance cos¹⁰ i.

Otherwise it goes on to what lies behind. Seen straight on, glass is a wall; half of the beams are
lost at 21°, nearly all at 45°: glass is seen from a narrow range of angles alone [Foster, Sun,
Park, Kuipers, *VisAGGE: Visible angle grid for glass environments*, ICRA 2013].
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.errors import ConfigError
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation.ranges import first_walls, rays

PANE = 1.5  # m, the side of the squares of the map that are glazed or not
SHARPNESS = 10


def panes(grid: OccupancyGrid, share: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    """(height, width): the occupied cells that are glass.

    The map is cut into squares of 1.5 m; what is occupied in one is glass with the chance `share`.
    Raises ConfigError for a share that is not from 0 to 1.
    """
    if not 0.0 <= share <= 1.0:
        raise ConfigError(f"the share of glass must be from 0 to 1, got {share}")
    side = max(1, round(PANE / grid.resolution))
    height, width = grid.cells.shape
    squares = rng.random((-(-height // side), -(-width // side))) < share
    glazed = squares.repeat(side, axis=0).repeat(side, axis=1)[:height, :width]
    return glazed & grid.occupied


def ranges_past_glass(
    grid: OccupancyGrid,
    glass: NDArray[np.bool_],
    sensor_poses: ArrayLike,
    angles: NDArray[np.float64],
    range_max: float,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """(N, B) metres as `ranges`, but through those of the cells `glass` that a beam passes."""
    start, direction = rays(grid, sensor_poses, angles)
    hits = first_walls(grid.occupied, grid.resolution, start, direction, range_max)
    met = np.isfinite(hits.length) & glass[hits.cell[1], hits.cell[0]]
    incidence = np.abs(np.take_along_axis(direction, hits.axis[None], axis=0)[0])  # its cosine
    passed = met & (rng.random(len(met)) >= incidence**SHARPNESS)
    behind = first_walls(
        grid.occupied & ~glass, grid.resolution, start[:, passed], direction[:, passed], range_max
    )
    hits.length[passed] = behind.length
    return hits.length.reshape(-1, len(angles))
