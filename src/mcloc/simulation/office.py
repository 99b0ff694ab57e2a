"""Offices: rooms on both sides of a corridor."""

from itertools import pairwise

import numpy as np

from mcloc.errors import ConfigError
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.simulation.floor import WALL, Box, Floor

ROOM = 4.0  # m, the mean width of those below the corridor
DEPTH = 15.0  # m
DOOR = 1.0  # m
CORRIDOR = (6.0, 7.8)  # m, from and to in y
MIDDLE = (6.6, 8.4)  # m, the corridor of a symmetric floor


def office_world(
    seed: int = 0, resolution: float = 0.05, *, rooms: int = 9, symmetric: bool = False
) -> OccupancyGrid:
    """A floor 15 m deep, and 20 m wide for nine rooms: unlike ones on both sides of a corridor.

    The seed places walls, doors and furniture; the map frame's origin is the floor's lower left
    corner. Around the floor, 0.5 m are unknown. resolution: metres a cell, at most 0.1, or walls
    get holes. More rooms lie below the corridor than above. A symmetric floor is the same after
    half a turn, so that there are two places for all that a robot sees; it has an even number of
    rooms, one more than asked for where need be. Raises ConfigError for less than 3 rooms and for
    a resolution that cannot be.
    """
    if rooms < 3:
        raise ConfigError(f"an office has at least 3 rooms, got {rooms}")
    below = (rooms + 1) // 2 if symmetric else rooms // 2 + 1
    floor = Floor(ROOM * below, DEPTH, resolution)
    rng = np.random.default_rng(seed)
    start, end = MIDDLE if symmetric else CORRIDOR
    width = ROOM * below
    floor.fill(Box(WALL, start, width - WALL, end), FREE)
    _row_of_rooms(floor, below, Box(0.0, WALL, width, start - WALL), start - WALL, rng)
    if symmetric:
        half = len(floor.cells) // 2
        floor.cells[half:] = floor.cells[: len(floor.cells) - half][::-1, ::-1]
        return floor.grid(f"office_world({seed}, symmetric)")
    _row_of_rooms(floor, rooms - below, Box(0.0, end + WALL, width, DEPTH - WALL), end, rng)
    return floor.grid(f"office_world({seed})")


def _row_of_rooms(
    floor: Floor, n: int, row: Box, doorstep: float, rng: np.random.Generator
) -> None:
    """n furnished rooms side by side, a wall between neighbours.

    doorstep: y of the lower side of the wall that has their doors.
    """
    widths = rng.uniform(0.7, 1.3, n)
    shares = np.concatenate([[0.0], np.cumsum(widths) / widths.sum()])
    edges = row.left + WALL + (row.right - row.left - WALL) * shares
    rooms = [Box(left, row.bottom, right - WALL, row.top) for left, right in pairwise(edges)]
    outer = row.bottom if doorstep == row.top else row.top
    for room in rooms:
        floor.fill(room, FREE)
        hinge = rng.uniform(room.left + 0.3, room.right - DOOR - 0.3)
        floor.fill(Box(hinge, doorstep, hinge + DOOR, doorstep + WALL), FREE)
        for piece in _furniture(room, outer, rng):
            floor.fill(piece, OCCUPIED)


def _furniture(room: Box, outer: float, rng: np.random.Generator) -> list[Box]:
    """A cupboard along the outer wall, and a table with a metre of free floor all around it.

    outer: y of the wall that has no door.
    """
    depth = rng.uniform(0.35, 0.6)
    bottom = outer if outer == room.bottom else outer - depth
    wall = Box(room.left, bottom, room.right, bottom + depth)
    middle = Box(room.left + 1.0, room.bottom + 1.2, room.right - 1.0, room.top - 1.2)
    width = rng.uniform(0.5, 1.0) * min(1.6, middle.right - middle.left)
    height = rng.uniform(0.5, 1.0) * min(0.9, middle.top - middle.bottom)
    return [wall.place(rng.uniform(0.8, 1.6), depth, rng), middle.place(width, height, rng)]
