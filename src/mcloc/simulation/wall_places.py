"""Places along the walls of a world, to fix things to."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from mcloc.errors import MapError
from mcloc.geometry import compose
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation.spread import spread

CANDIDATES = 10  # for each place, of which those are taken that are far from each other


def wall_places(grid: OccupancyGrid, n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """(n, 2) metres, map frame: free cells at a wall, far from each other. Raises MapError where
    there are not so many.
    """
    cells = np.argwhere(grid.free & binary_dilation(grid.occupied))[:, ::-1]
    if len(cells) < n:
        raise MapError(
            f"{grid.name}: its walls have no room for {n} things; {len(cells)} of its free cells "
            "are beside an occupied one"
        )
    some = rng.choice(len(cells), min(CANDIDATES * n, len(cells)), replace=False)
    local = (cells[some] + 0.5) * grid.resolution
    places = compose(grid.origin, np.insert(local, 2, 0.0, axis=1))[:, :2]
    return places[spread(places, n)]
