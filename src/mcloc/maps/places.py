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

KINDS = ("corridor", "junction", "room", "dead end")


@dataclass(frozen=True, eq=False)
class Places:
    """nearest: (height, width) the node that each cell of the map belongs to or is nearest to, from
    0. standing: (height, width) where a robot fits; what of that belongs to a node is connected.
    kinds, areas (K,) m², centres (K, 2) m in the map frame: of each node. edges: (E, 2), the lesser
    node first, sorted. passages: (E,) how wide they are, m.
    """

    grid: OccupancyGrid
    nearest: NDArray[np.int32]
    standing: NDArray[np.bool_]
    kinds: tuple[str, ...]
    areas: NDArray[np.float64]
    centres: NDArray[np.float64]
    edges: NDArray[np.intp]
    passages: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.kinds)


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
    node, elongated = cut(clearance, hills(clearance, standing), cell, piece)
    node = merged(clearance, node, cell, least)
    standing = node >= 0
    if not standing.any():
        raise MapError(
            f"{grid.name}: no place of {least:g} m² in which a robot of radius {radius:g} m fits"
        )
    _, (row, column) = distance_transform_edt(~standing, return_indices=True)
    nearest = node[row, column].astype(np.int32)
    edges, widest = passages(clearance, node)
    areas = (np.bincount(node[standing]) * cell**2).astype(np.float64)
    corridor = np.bincount(node[standing], elongated[standing]) * cell**2 > 0.5 * areas
    kinds = _kinds(edges, corridor)
    centres = _centres(grid, node)
    return Places(grid, nearest, standing, kinds, areas, centres, edges, 2.0 * widest)


def _kinds(edges: NDArray[np.intp], corridor: NDArray[np.bool_]) -> tuple[str, ...]:
    """What each node is. Where three corridors meet is a junction; a corridor that leads to one
    node, or to none, is a dead end.
    """
    degree = np.bincount(edges.ravel(), minlength=len(corridor))
    both = np.concatenate([edges, edges[:, ::-1]])
    corridors = np.bincount(both[:, 0], corridor[both[:, 1]], minlength=len(corridor))
    dead_end = corridor & (degree <= 1)
    chosen = np.select([corridors >= 3, dead_end, corridor], [1, 3, 0], default=2)
    return tuple(KINDS[k] for k in chosen)


def _centres(grid: OccupancyGrid, node: NDArray[np.int64]) -> NDArray[np.float64]:
    """(K, 2): the mean of each node's cells, map frame."""
    row, column = np.nonzero(node >= 0)
    of = node[row, column]
    n = np.bincount(of)
    middle = [(np.bincount(of, axis) / n + 0.5) * grid.resolution for axis in (column, row)]
    local = np.stack([*middle, np.zeros(len(n))], axis=-1)
    return compose(grid.origin, local)[:, :2]
