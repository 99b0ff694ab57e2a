"""What looks wrong in a map: walls are thin and rooms are wide, and nobody sees into a wall.

How wide a kind of cells is, its depth tells: 90 % of its cells lie within this distance of cells of
another kind.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from mcloc.inspection.finding import Finding
from mcloc.maps.occupancy import OccupancyGrid

NARROW = 0.4  # m; floors reach 0.8 m and more from their walls, in every map that was measured
THICKER = 2.0  # an inverted map's "walls" are rooms: this many times deeper than its "floor"

INSIDE = 0.3  # m into a wall; walls are at most twice as thick, and a laser sees their faces
SOLID = 0.05  # share of the map's cells that may lie so deep where a map knows no unknown
FEW = 0.01  # share of unknown cells below which a map knows none

COARSE, FINE = 0.5, 0.01  # m a cell: as large as a robot, and finer than a laser's noise
PASSABLE = 0.1  # m; where all floor is as near to walls as that, no robot passes


def inspect_map(grid: OccupancyGrid) -> list[Finding]:
    """What looks wrong: the first that is found, since the others rest on its absence."""
    checks: tuple[Callable[[OccupancyGrid], Finding | None], ...] = (
        nothing_occupied,
        nothing_free,
        inverted,
        implausible_resolution,
        unknown_as_walls,
    )
    found = next((finding for check in checks if (finding := check(grid))), None)
    return [] if found is None else [found]


def depth(grid: OccupancyGrid, kind: NDArray[np.bool_]) -> float:
    """Metres: 90 % of the cells of this kind lie within this distance of another kind.

    kind: (height, width), neither all nor none of the cells.
    """
    return float(np.percentile(_depths(grid, kind)[kind], 90.0))


def nothing_occupied(grid: OccupancyGrid) -> Finding | None:
    """A map without a wall explains no scan."""
    if grid.occupied.any():
        return None
    return _finding(
        "map-nothing-occupied",
        "no cell is occupied",
        f"the highest value is {grid.cells.max()} %; walls begin at occupied_thresh ="
        f" {grid.occupied_thresh:g}",
        "check occupied_thresh, mode and the image",
    )


def nothing_free(grid: OccupancyGrid) -> Finding | None:
    """On a map without a free cell no robot can stand."""
    if grid.free.any():
        return None
    known = grid.cells[grid.cells >= 0]
    lowest = f"the lowest value is {known.min()} %" if known.size else "all cells are unknown"
    return _finding(
        "map-nothing-free",
        "no cell is free",
        f"{lowest}; free cells end at free_thresh = {grid.free_thresh:g}",
        "check free_thresh, negate, mode and the image",
    )


def inverted(grid: OccupancyGrid) -> Finding | None:
    """Rooms are wider than walls are thick: where it is the other way round, they are swapped.

    What is free is nowhere wider than NARROW, and what is occupied is THICKER times as deep.
    """
    free, occupied = depth(grid, grid.free), depth(grid, grid.occupied)
    if free >= NARROW or occupied < THICKER * free:
        return None
    return _finding(
        "map-inverted",
        "walls and free space look swapped",
        f"90 % of the free cells lie within {free:.2f} m of others, the occupied ones within"
        f" {occupied:.2f} m: walls as wide as rooms, rooms as thin as walls",
        "change negate (0 to 1, or 1 to 0) in the map's YAML, or invert its image",
    )


def implausible_resolution(grid: OccupancyGrid) -> Finding | None:
    """Cells are smaller than a robot and not finer than a laser's noise; floors let it pass."""
    free = depth(grid, grid.free)
    if FINE <= grid.resolution < COARSE and free >= PASSABLE:
        return None
    height, width = np.array(grid.cells.shape) * grid.resolution
    return _finding(
        "map-resolution",
        f"a resolution of {grid.resolution:g} m a cell is hardly right",
        f"the map would be {width:g} m × {height:g} m, and 90 % of its free cells within"
        f" {free:.3g} m of walls",
        "give the resolution in metres a cell; 0.05 is usual",
    )


def unknown_as_walls(grid: OccupancyGrid) -> Finding | None:
    """A laser sees the faces of walls: what lies behind is unknown, not occupied.

    Hardly a cell is unknown, and more than SOLID of the cells are occupied and lie INSIDE others.
    """
    solid = (_depths(grid, grid.occupied) > INSIDE).mean()
    unknown = grid.unknown.mean()
    if unknown >= FEW or solid <= SOLID:
        return None
    return _finding(
        "map-unknown-as-walls",
        "space that nobody saw looks drawn as walls",
        f"{100 * solid:.0f} % of the map lie more than {INSIDE} m inside of walls, and"
        f" {100 * unknown:.1f} % are unknown",
        "make it unknown: grey 205 in the image, between free_thresh and occupied_thresh",
    )


def _depths(grid: OccupancyGrid, kind: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(height, width) metres to the nearest cell of another kind, 0 outside of the kind."""
    cells: NDArray[np.float64] = distance_transform_edt(kind)
    return cells * grid.resolution


def _finding(check: str, what: str, evidence: str, remedy: str) -> Finding:
    return Finding(check, "map", what, evidence, remedy)


def describe_map(grid: OccupancyGrid) -> dict[str, Any]:
    """In numbers: metres, radians, shares of its cells."""
    rows, columns = grid.cells.shape
    return {
        "width_m": columns * grid.resolution,
        "height_m": rows * grid.resolution,
        "columns": columns,
        "rows": rows,
        "resolution_m": grid.resolution,
        "origin": dict(zip(("x", "y", "theta"), map(float, grid.origin), strict=True)),
        "occupied_thresh": grid.occupied_thresh,
        "free_thresh": grid.free_thresh,
        "free": float(grid.free.mean()),
        "occupied": float(grid.occupied.mean()),
        "unknown": float(grid.unknown.mean()),
    }
