"""Routes to drive and to walk: from place to place by short ways that keep clear of walls."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from mcloc.errors import ConfigError, MapError
from mcloc.geometry import compose
from mcloc.maps.occupancy import OccupancyGrid

CLEARANCE = 0.35  # m from a robot's or a person's centre to all that is not free
RASTER = 0.1  # m between two places, or a cell where cells are larger
ROOM = 1.0  # m: where one place is never this far from another, there is no driving
COMFORT = 0.8  # m: a way this far from walls is not made longer to be farther still
DISCOMFORT = 4.0  # a way along a wall costs this many times its length more
DETOUR = 1.5  # m of cost for each metre as the crow flies: how far to look for a way at first


class Roadmap:
    """The places where one can stand, and the short ways between them.

    Only the largest part of the map is used in which one place leads to all others.
    points: (P, 2) metres, map frame; a place is an index into them. clearance: metres from each to
    all that is not free. Raises MapError where there is no room to drive.
    """

    def __init__(self, grid: OccupancyGrid, clearance: float = CLEARANCE) -> None:
        every = max(1, round(RASTER / grid.resolution))
        first = every // 2
        to_wall = ndimage.distance_transform_edt(np.pad(grid.free, 1))[1:-1, 1:-1]
        to_wall = to_wall[first::every, first::every] * grid.resolution
        regions, _ = ndimage.label(to_wall > clearance, structure=np.ones((3, 3)))
        largest = 1 + int(np.bincount(regions.ravel(), minlength=2)[1:].argmax())
        cells = np.argwhere(regions == largest)
        raster = every * grid.resolution
        if not len(cells) or np.ptp(cells, axis=0).max() * raster < ROOM:
            raise MapError(f"{grid.name}: no robot can drive here {clearance} m clear of walls")
        self._graph = _graph(cells, to_wall, raster)
        centres = (cells[:, ::-1] * every + first + 0.5) * grid.resolution
        self.points = compose(grid.origin, np.insert(centres, 2, 0.0, axis=1))[:, :2]
        self._near = KDTree(self.points)

    def random(self, rng: np.random.Generator) -> int:
        """Any place."""
        return int(rng.integers(len(self.points)))

    def nearest(self, point: NDArray[np.float64]) -> int:
        """The place next to (x, y)."""
        return int(self._near.query(point)[1])

    def within(self, radius: float, point: NDArray[np.float64]) -> NDArray[np.intp]:
        """The places up to `radius` metres away from (x, y)."""
        return np.array(self._near.query_ball_point(point, radius), dtype=np.intp)

    def sees(self, start: int, goal: int) -> bool:
        """Whether one can go from start to goal straight ahead."""
        a, b = self.points[start], self.points[goal]
        off, _ = self._near.query(np.linspace(a, b, 2 + int(np.hypot(*(b - a)) / RASTER)))
        return bool(np.max(off) <= RASTER)

    def toward(self, goal: int, reach: float = np.inf) -> NDArray[np.int32]:
        """(P,): from each place the next one on its way to the goal, < 0 at the goal itself.

        reach: metres of a comfortable way from the goal; < 0 too where the way is longer.
        """
        _, after = dijkstra(
            self._graph, indices=np.array([goal]), limit=reach, return_predecessors=True
        )
        next_places: NDArray[np.int32] = after[0]
        return next_places

    def way(self, start: int, goal: int) -> list[int]:
        """The places from start to goal, both included."""
        reach = DETOUR * float(np.hypot(*(self.points[goal] - self.points[start]))) + 1.0
        after = self.toward(goal, reach)
        while after[start] < 0 and start != goal:
            reach *= 2.0
            after = self.toward(goal, reach)
        return way_along(after, start)

    def tour(
        self, length: float, rng: np.random.Generator, start: int | None = None
    ) -> NDArray[np.float64]:
        """(K, 2) points, a step of the raster apart, from one random place to the next.

        It is `length` metres long, up to a step. Raises ConfigError for one that is not > 0.
        """
        if not 0.0 < length < np.inf:
            raise ConfigError(f"the length of a drive must be > 0 m, got {length}")
        route = [self.random(rng) if start is None else start]
        driven = np.zeros(1)
        while driven[-1] < length:
            route += self.way(route[-1], self.random(rng))[1:]
            driven = travelled(self.points[route])
        return self.points[route][: int((driven <= length).sum())]


def tour(
    grid: OccupancyGrid, length: float, seed: int, *, clearance: float = CLEARANCE
) -> NDArray[np.float64]:
    """(K, 2) points in the map frame of a drive `length` metres long, see `Roadmap`."""
    return Roadmap(grid, clearance).tour(length, np.random.default_rng(seed))


def way_along(after: NDArray[np.int32], start: int) -> list[int]:
    """The places from start to the goal of `Roadmap.toward`."""
    way = [start]
    while after[way[-1]] >= 0:
        way.append(int(after[way[-1]]))
    return way


def travelled(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(K,) metres from the first of the points (K, 2) to each."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _graph(cells: NDArray[np.intp], to_wall: NDArray[np.float64], raster: float) -> csr_array:
    """Costs of the steps between cells that touch, in metres of a comfortable way.

    cells: (P, 2) rows and columns of the table to_wall, in metres.
    """
    index = np.full(np.add(to_wall.shape, 2), -1)  # a border of no cells around the grid
    index[tuple(cells.T + 1)] = np.arange(len(cells))
    factor = 1.0 + DISCOMFORT * np.maximum(0.0, 1.0 - to_wall[tuple(cells.T)] / COMFORT)
    start, end, cost = [], [], []
    for step in ((0, 1), (1, -1), (1, 0), (1, 1), (0, -1), (-1, 1), (-1, 0), (-1, -1)):
        neighbour = index[tuple((cells + 1 + step).T)]
        a = np.flatnonzero(neighbour >= 0)
        b = neighbour[a]
        start.append(a)
        end.append(b)
        cost.append(raster * np.hypot(*step) * (factor[a] + factor[b]) / 2.0)
    edges = [np.concatenate(ends).astype(np.int32) for ends in (start, end)]  # all dijkstra takes
    return csr_array((np.concatenate(cost), tuple(edges)), shape=(len(cells), len(cells)))
