"""A museum: wide halls with wide openings between them, pillars and showcases.

The walls are often out of a laser's reach, and people stand between it and them.
"""

import numpy as np

from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.simulation.floor import Box, Floor

WIDTH, DEPTH = 40.0, 30.0  # m
HALF = 0.15  # m, of a wall's thickness
OPENING = (3.0, 5.0)  # m, least and largest width
BAY = 5.0  # m between pillars
PILLARS = 0.7  # of the places for a pillar that have one
SHOWCASES = 6  # in a hall, where there is room for them
AROUND = 1.4  # m of free floor around a showcase
TRIES = 50  # to find a place for one


def museum_world(seed: int = 0, resolution: float = 0.05) -> OccupancyGrid:
    """A floor of 40 m × 30 m: four halls, each open to two others.

    The seed places walls, openings, pillars and showcases; the map frame's origin is the floor's
    lower left corner. Around the floor, 0.5 m are unknown. resolution: metres a cell, at most 0.1.
    Raises ConfigError otherwise.
    """
    rng = np.random.default_rng(seed)
    floor = Floor(WIDTH, DEPTH, resolution)
    middle = rng.uniform(0.4, 0.6) * WIDTH
    # The halls on the left are cut in two lower than those on the right.
    cuts = rng.uniform((0.35, 0.5), (0.45, 0.6)) * DEPTH
    sides = ((HALF, middle), (middle, WIDTH - HALF))
    halls = []
    for (left, right), cut in zip(sides, cuts, strict=True):
        for bottom, top in ((HALF, cut), (cut, DEPTH - HALF)):
            halls.append(Box(left, bottom, right, top).grown(-HALF))
            floor.fill(halls[-1], FREE)
        start, end = _opening(left, right, rng)
        floor.fill(Box(start, cut - HALF, end, cut + HALF), FREE)
    for bottom, top in ((HALF, cuts[0]), (cuts[1], DEPTH - HALF)):
        start, end = _opening(bottom, top, rng)
        floor.fill(Box(middle - HALF, start, middle + HALF, end), FREE)
    for hall in halls:
        _pillars(floor, hall, rng)
        _showcases(floor, hall, rng)
    return floor.grid(f"museum_world({seed})")


def _opening(start: float, end: float, rng: np.random.Generator) -> tuple[float, float]:
    """Where a wall from start to end is open."""
    width = rng.uniform(*OPENING)
    at = rng.uniform(start + 1.0, end - 1.0 - width)
    return at, at + width


def _pillars(floor: Floor, hall: Box, rng: np.random.Generator) -> None:
    """Rows of pillars, all round or all square, some left out."""
    radius, is_round = rng.uniform(0.25, 0.4), rng.random() < 0.5
    for x in np.arange(hall.left + BAY / 2, hall.right - BAY / 2, BAY):
        for y in np.arange(hall.bottom + BAY / 2, hall.top - BAY / 2, BAY):
            if rng.random() > PILLARS:
                continue
            if is_round:
                floor.column(x, y, radius)
            else:
                floor.fill(Box(x, y, x, y).grown(radius), OCCUPIED)


def _showcases(floor: Floor, hall: Box, rng: np.random.Generator) -> None:
    """Boxes that stand free, lengthwise or across."""
    for _ in range(SHOWCASES):
        size = rng.uniform((0.6, 1.2), (1.0, 2.4))
        width, height = rng.permutation(size)
        for _ in range(TRIES):
            case = hall.grown(-AROUND).place(width, height, rng)
            if floor.is_free(case.grown(AROUND)):
                floor.fill(case, OCCUPIED)
                break
