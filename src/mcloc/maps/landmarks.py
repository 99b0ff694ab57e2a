"""Landmarks: places that a robot recognizes, by name."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.errors import MapError
from mcloc.maps.occupancy import FARTHEST, FREE, OccupancyGrid

OPEN_CELL = 0.1  # m, of a floor without walls
MOST_CELLS = 10_000_000


@dataclass(frozen=True, eq=False)
class Landmarks:
    """names: as users and logs call them. places: (L, 2) metres, map frame.

    Raises MapError for tables that do not fit, places that are not finite, and names that are there
    twice.
    """

    names: Sequence[str]
    places: NDArray[np.float64]
    name: str = "landmarks"  # of the file, for messages

    def __post_init__(self) -> None:
        if len(self.names) == 0:
            raise MapError(f"{self.name}: there is no landmark in it")
        places = np.array(self.places, dtype=np.float64).reshape(len(self.names), -1)
        if places.shape[1] != 2 or not (np.abs(places) < FARTHEST).all():
            raise MapError(
                f"{self.name}: each landmark needs finite x, y in metres, less than {FARTHEST:g} "
                "away"
            )
        if len(set(self.names)) < len(self.names):
            twice = next(name for name in self.names if list(self.names).count(name) > 1)
            raise MapError(f"{self.name}: landmark {twice} is there twice")
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "places", places)

    @cached_property
    def checksum(self) -> str:
        """The same for the same landmarks."""
        told = "\n".join(self.names).encode() + self.places.tobytes()
        return hashlib.sha256(told).hexdigest()

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
