"""The graph of a map: regions of free space are its nodes, passages that a robot fits through its
edges  [Fox99, topological Markov localization; Thrun: Learning metric-topological maps for indoor
mobile robot navigation, Artificial Intelligence 99, 1998, §3].
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from mcloc.errors import MapError
from mcloc.geometry import compose
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.maps.regions import cut, hills, merged, passages


@dataclass(frozen=True, eq=False)
class Places:
    """nearest: (height, width) the node that each cell of the map belongs to or is nearest to, from
    0. standing: (height, width) where a robot fits; what of that belongs to a node is connected.
    areas (K,) m², centres (K, 2) m in the map frame: of each node. edges: (E, 2), the lesser node
    first, sorted.
    """

    grid: OccupancyGrid
    nearest: NDArray[np.int32]
    standing: NDArray[np.bool_]
    areas: NDArray[np.float64]
    centres: NDArray[np.float64]
    edges: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.areas)


def places(
    grid: OccupancyGrid, radius: float = 0.25, piece: float = 3.0, least: float = 1.0
) -> Places:
    """The graph of a map for a robot of this radius (m).

    Regions are the hills of the distance to what is not free, parted at doors. Corridors are cut
    into pieces about as long as `piece` (m), and so are halls. What is smaller than `least` (m²)
    becomes part of a neighbour, and where it has none no place at all: a pocket that was seen
    through a gap. Larger ones that nothing leads to stay. Raises MapError for a map without a place
    for such a robot.
    """
    clearance = distance_transform_edt(np.pad(grid.free, 1))[1:-1, 1:-1] * grid.resolution
    standing = clearance >= radius
    cell = grid.resolution
    node = cut(clearance, hills(clearance, standing), cell, piece)
    node = merged(clearance, node, cell, least)
    standing = node >= 0
    if not standing.any():
        raise MapError(
            f"{grid.name}: no place of {least:g} m² in which a robot of radius {radius:g} m fits"
        )
    _, (row, column) = distance_transform_edt(~standing, return_indices=True)
    nearest = node[row, column].astype(np.int32)
    edges, _ = passages(clearance, node)
    areas = (np.bincount(node[standing]) * cell**2).astype(np.float64)
    return Places(grid, nearest, standing, areas, _centres(grid, node), edges)


def _centres(grid: OccupancyGrid, node: NDArray[np.int64]) -> NDArray[np.float64]:
    """(K, 2): the mean of each node's cells, map frame."""
    row, column = np.nonzero(node >= 0)
    of = node[row, column]
    n = np.bincount(of)
    middle = [(np.bincount(of, axis) / n + 0.5) * grid.resolution for axis in (column, row)]
    local = np.stack([*middle, np.zeros(len(n))], axis=-1)
    return compose(grid.origin, local)[:, :2]
