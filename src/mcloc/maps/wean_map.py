"""CMU's wean.dat: a header, then each cell's chance to be free, a line along y for each x.

    robot_specifications->resolution  10        cm a cell
    global_map[0]: 800 800                      cells in x, in y
    -1.000 -1.000 0.998 …                       −1 unknown, 0 wall … 1 free

The files' own notes name 0 and 1 the other way round: scans laid over the map settle it.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import MapError
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.textfile import TextFile

START = "global_map[0]:"
RESOLUTION = "robot_specifications->resolution"


def read(text: TextFile) -> OccupancyGrid:
    """The map; its origin is (0, 0, 0). Raises MapError."""
    lines = ((number, words) for number, line in text.lines() if (words := line.split()))
    resolution: float | None = None
    for number, words in lines:
        try:
            if words[0] == RESOLUTION:
                resolution = float(words[1]) / 100.0
            if words[0] == START:
                columns, rows = int(words[1]), int(words[2])
                break
        except (ValueError, IndexError) as cause:
            raise text.fault(number, f"{words[0]} must be followed by numbers") from cause
    else:
        raise MapError(f"{text.path}: has no line {START} WIDTH HEIGHT")
    if resolution is None:
        raise MapError(f"{text.path}: has no line {RESOLUTION} CENTIMETRES")
    if columns < 1 or rows < 1:
        raise text.fault(number, f"a map of {columns} × {rows} cells is empty")
    cells = np.stack(list(_columns(text, lines, columns, rows)), axis=1)
    return OccupancyGrid(cells, resolution, np.zeros(3), name=text.path)


def _columns(
    text: TextFile, lines: Iterator[tuple[int, list[str]]], columns: int, rows: int
) -> Iterator[NDArray[np.int8]]:
    """The cells of each x, in percent occupied; nothing is allocated on the header's word."""
    found = 0
    for number, words in lines:
        found += 1
        if found > columns:
            raise text.fault(number, f"more than the {columns} lines of cells that {START} says")
        if len(words) != rows:
            raise text.fault(number, f"{rows} cells expected, {len(words)} found")
        try:
            free = np.array([float(word) for word in words], dtype=np.float64)
        except ValueError as cause:
            raise text.fault(number, str(cause)) from cause
        unknown = free == -1.0
        if not (unknown | ((free >= 0.0) & (free <= 1.0))).all():
            raise text.fault(number, "a cell must be −1 or between 0 and 1")
        yield np.where(unknown, -1.0, np.rint(100.0 * (1.0 - free))).astype(np.int8)
    if found < columns:
        raise MapError(f"{text.path}: ends after {found} of {columns} lines of cells; it is cut")
