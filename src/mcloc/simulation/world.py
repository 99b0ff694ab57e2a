"""Worlds to drive in, by name."""

from collections.abc import Callable
from functools import partial

from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation.museum import museum_world
from mcloc.simulation.office import office_world

WORLDS: dict[str, Callable[[int], OccupancyGrid]] = {
    "office": office_world,
    "symmetric-office": partial(office_world, symmetric=True),
    "museum": museum_world,
}
"""Each makes its map from a seed."""
