"""How far a ray may leap: for each cell and each of the 8 octants of directions, the number of
columns that no ray of the octant, from wherever in the cell, can find blocked.

Within an octant a ray goes one column at a time along its major axis k, and rises by at most one
cell along its minor axis r. From the cell (k, r) it can meet, j columns on, the rows r … r + j + 1:
the columns of the cone at (k, r) are the cells (k, r), (k, r + 1) and then those of the cones at
(k + 1, r) and (k + 1, r + 1). So

    n(k, r) = 1 + min( n(k + 1, r), n(k + 1, r + 1) )    where (k, r) and (k, r + 1) are passable.
"""

import numpy as np

from mcloc.kernels.jit import kernel

PASSABLE, SOLID, UNSEEN = 0, 1, 2  # cells as they come in

WALL, UNKNOWN = 0, 255  # the cell itself ends a ray
BESIDE_WALL, BESIDE_UNKNOWN = 253, 254  # its neighbour at r + 1 does, where the ray rises into it
LARGEST_LEAP = 252


@kernel
def octant_leaps(stops, leaps):  # type: ignore[no-untyped-def]
    """leaps (K, R) uint8: 1 … LARGEST_LEAP columns, or what ends a ray.

    stops: (K, R) uint8, PASSABLE, SOLID or UNSEEN, the octant's axes rising; its outermost ring is
    UNSEEN.
    """
    columns, rows = stops.shape
    leaps[columns - 1] = UNKNOWN
    for k in range(columns - 2, -1, -1):
        here, ahead, out = stops[k], leaps[k + 1], leaps[k]
        for r in range(rows - 1):
            straight, risen = ahead[r], ahead[r + 1]
            straight = straight if straight <= LARGEST_LEAP else np.uint8(0)
            risen = risen if risen <= LARGEST_LEAP else np.uint8(0)
            least = straight if straight < risen else risen
            leap = least + np.uint8(1) if least < LARGEST_LEAP else np.uint8(LARGEST_LEAP)
            side = here[r + 1]
            beside = np.uint8(BESIDE_WALL) if side == SOLID else np.uint8(BESIDE_UNKNOWN)
            ended = np.uint8(WALL) if here[r] == SOLID else np.uint8(UNKNOWN)
            free = leap if side == PASSABLE else beside
            out[r] = free if here[r] == PASSABLE else ended
        out[rows - 1] = UNKNOWN


def leaps_of(stops: np.ndarray) -> np.ndarray:
    """(8 · height · width,) uint8: the leaps of all octants, one after the other.

    stops: (height, width). Octant 4 down + 2 left + steep, each in its own axes: those that a ray
    goes against are turned round, and the first axis is the major one, y for steep rays.
    """
    leaps = np.empty((8, stops.size), dtype=np.uint8)
    for octant in range(8):
        down, left, steep = octant & 4, octant & 2, octant & 1
        seen = stops[::-1] if down else stops
        seen = seen[:, ::-1] if left else seen
        seen = np.ascontiguousarray(seen if steep else seen.T)
        octant_leaps(seen, leaps[octant].reshape(seen.shape))
    return leaps.ravel()
