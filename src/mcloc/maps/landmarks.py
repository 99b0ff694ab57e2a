"""Landmarks: places that a robot recognizes, by name."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.errors import MapError
from mcloc.maps.named_places import NamedPlaces
from mcloc.maps.occupancy import FREE, OccupancyGrid

OPEN_CELL = 0.1  # m, of a floor without walls
MOST_CELLS = 10_000_000


@dataclass(frozen=True, eq=False)
class Landmarks(NamedPlaces):
    """Landmarks by name, at places (L, 2). Errors: NamedPlaces."""

    called: ClassVar[str] = "landmark"
    axes: ClassVar[tuple[str, ...]] = ("x", "y")

    name: str = "landmarks"

    @classmethod
    def numbered(cls, places: ArrayLike) -> "Landmarks":
        """Places (L, 2) that are called 0, 1, …"""
        table = np.asarray(places, dtype=np.float64)
        return cls([str(k) for k in range(len(table))], table)


def open_floor(places: NDArray[np.float64], reach: float, name: str) -> OccupancyGrid:
    """A map without walls: the box around places (L, 2), wider by `reach` metres on all sides,
    which is where a robot can see one of them from. Raises MapError where that is too large.
    """
    low, high = places.min(axis=0) - reach, places.max(axis=0) + reach
    columns, rows = np.ceil((high - low) / OPEN_CELL).astype(int).tolist()
    if rows * columns > MOST_CELLS:
        raise MapError(
            f"{name}: covers {columns * OPEN_CELL:.0f} m × {rows * OPEN_CELL:.0f} m, which is more "
            "than a floor; are its units metres?"
        )
    cells = np.full((rows, columns), FREE, dtype=np.int8)
    return OccupancyGrid(cells, OPEN_CELL, np.array([*low, 0.0]), name=name)
