"""Routes for a robot to drive: from place to place by short ways that keep clear of walls."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from mcloc.errors import MapError
from mcloc.geometry import compose
from mcloc.maps.occupancy import OccupancyGrid

COMFORT = 0.8  # m: a way this far from walls is not made longer to be farther still
DISCOMFORT = 4.0  # a way along a wall costs this many times its length more


def tour(
    grid: OccupancyGrid, length: float, seed: int, *, clearance: float = 0.35
) -> NDArray[np.float64]:
    """(K, 2) points in the map frame, a cell apart, of a drive `length` metres long.

    It goes from one random place to the next, in the largest part of the map where a robot can be
    `clearance` metres away from everything that is not free. Raises MapError if there is none.
    """
    to_wall = ndimage.distance_transform_edt(np.pad(grid.free, 1))[1:-1, 1:-1] * grid.resolution
    regions, _ = ndimage.label(to_wall > clearance, structure=np.ones((3, 3)))
    sizes = np.bincount(regions.ravel())[1:]
    if not sizes.size or sizes.max() < 2:
        raise MapError(f"{grid.name}: no robot can drive here {clearance} m clear of walls")
    cells = np.argwhere(regions == 1 + sizes.argmax())
    graph = _graph(cells, to_wall)

    rng = np.random.default_rng(seed)
    route = [int(rng.integers(len(cells)))]
    travelled = np.zeros(1)
    while travelled[-1] < length:
        goal = int(rng.integers(len(cells)))
        _, toward = dijkstra(graph, directed=False, indices=[goal], return_predecessors=True)
        while route[-1] != goal:
            route.append(int(toward[0, route[-1]]))
        steps = np.diff(cells[route], axis=0) * grid.resolution
        travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*steps.T))])

    rows, columns = cells[route][travelled <= length].T
    points = np.stack([columns + 0.5, rows + 0.5, np.zeros(len(rows))], axis=-1)
    points[:, :2] *= grid.resolution
    return compose(grid.origin, points)[:, :2]


def _graph(cells: NDArray[np.intp], to_wall: NDArray[np.float64]) -> csr_array:
    """Costs of the steps between cells that touch; cells: (C, 2) rows and columns."""
    index = np.full(np.add(to_wall.shape, 2), -1)  # a border of no cells around the grid
    index[tuple(cells.T + 1)] = np.arange(len(cells))
    factor = 1.0 + DISCOMFORT * np.maximum(0.0, 1.0 - to_wall[tuple(cells.T)] / COMFORT)
    start, end, cost = [], [], []
    for step in ((0, 1), (1, -1), (1, 0), (1, 1)):
        neighbour = index[tuple((cells + 1 + step).T)]
        a = np.flatnonzero(neighbour >= 0)
        b = neighbour[a]
        start.append(a)
        end.append(b)
        cost.append(np.hypot(*step) * (factor[a] + factor[b]) / 2.0)
    edges = [np.concatenate(ends).astype(np.int32) for ends in (start, end)]  # all dijkstra takes
    return csr_array((np.concatenate(cost), tuple(edges)), shape=(len(cells), len(cells)))
