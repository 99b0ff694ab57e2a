"""Worlds to drive in."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from mcloc.errors import ConfigError
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

WIDTH, DEPTH = 20.0, 15.0  # m
MARGIN = 0.5  # m of unknown around the floor
WALL = 0.15  # m
DOOR = 1.0  # m
ROOMS_BELOW, ROOMS_ABOVE = 5, 4  # of the corridor: unlike, so that half a turn does not fit
CORRIDOR = (6.0, 7.8)  # m, from and to in y


class Room(NamedTuple):
    """A rectangle in metres from the floor's lower left corner."""

    left: float
    bottom: float
    right: float
    top: float


def office_world(seed: int = 0, resolution: float = 0.05) -> OccupancyGrid:
    """A floor of 20 m × 15 m: nine rooms of unlike widths on both sides of a corridor.

    The seed places walls, doors and furniture; the map frame's origin is the floor's lower left
    corner. Around the floor, 0.5 m are unknown. resolution: metres a cell, at most 0.1, or walls
    get holes. Raises ConfigError otherwise.
    """
    if not 0.0 < resolution <= 0.1:
        raise ConfigError(f"resolution must be in (0, 0.1] m/cell, got {resolution}")
    rng = np.random.default_rng(seed)
    shape = [round((side + 2 * MARGIN) / resolution) for side in (DEPTH, WIDTH)]
    cells = np.full(shape, UNKNOWN, dtype=np.int8)

    def fill(room: Room, value: int) -> None:
        left, bottom, right, top = (round((v + MARGIN) / resolution) for v in room)
        cells[bottom:top, left:right] = value

    fill(Room(0.0, 0.0, WIDTH, DEPTH), OCCUPIED)
    fill(Room(WALL, CORRIDOR[0], WIDTH - WALL, CORRIDOR[1]), FREE)
    rows = (
        (ROOMS_BELOW, WALL, CORRIDOR[0] - WALL, CORRIDOR[0] - WALL),
        (ROOMS_ABOVE, CORRIDOR[1] + WALL, DEPTH - WALL, CORRIDOR[1]),
    )
    for n, bottom, top, doorstep in rows:
        for room in _row_of_rooms(n, bottom, top, rng):
            fill(room, FREE)
            hinge = rng.uniform(room.left + 0.3, room.right - DOOR - 0.3)
            fill(Room(hinge, doorstep, hinge + DOOR, doorstep + WALL), FREE)
            outer = bottom if doorstep == top else top
            for piece in _furniture(room, outer, rng):
                fill(piece, OCCUPIED)
    origin = np.array([-MARGIN, -MARGIN, 0.0])
    return OccupancyGrid(cells, resolution, origin, name=f"office_world({seed})")


def _row_of_rooms(n: int, bottom: float, top: float, rng: np.random.Generator) -> list[Room]:
    """n rooms side by side over the whole width, a wall between neighbours."""
    widths = rng.uniform(0.7, 1.3, n)
    edges = WALL + (WIDTH - WALL) * np.concatenate([[0.0], np.cumsum(widths) / widths.sum()])
    return [Room(left, bottom, right - WALL, top) for left, right in pairwise(edges)]


def _furniture(room: Room, outer: float, rng: np.random.Generator) -> list[Room]:
    """A cupboard along the outer wall, and a table with a metre of free floor all around it.

    outer: y of the wall that has no door.
    """
    depth = rng.uniform(0.35, 0.6)
    bottom = outer if outer == room.bottom else outer - depth
    wall = Room(room.left, bottom, room.right, bottom + depth)
    middle = Room(room.left + 1.0, room.bottom + 1.2, room.right - 1.0, room.top - 1.2)
    width = rng.uniform(0.5, 1.0) * min(1.6, middle.right - middle.left)
    height = rng.uniform(0.5, 1.0) * min(0.9, middle.top - middle.bottom)
    return [
        _within(wall, rng.uniform(0.8, 1.6), depth, rng),
        _within(middle, width, height, rng),
    ]


def _within(area: Room, width: float, height: float, rng: np.random.Generator) -> Room:
    """A rectangle of this size somewhere in the area."""
    left = area.left + rng.random() * (area.right - area.left - width)
    bottom = area.bottom + rng.random() * (area.top - area.bottom - height)
    return Room(left, bottom, left + width, bottom + height)
