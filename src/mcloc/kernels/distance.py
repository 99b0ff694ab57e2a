"""D(r, c) = min_j (c − j)² + g(r, j)², g(r, j) cells from row r to the nearest wall of column j:
exact squared distances to walls  [Felzenszwalb, Huttenlocher: Distance transforms of sampled
functions, Theory of Computing 8, 2012, Algorithm 1; g as in Meijster, Roerdink, Hesselink: A
general algorithm for computing distance transforms in linear time, 2000].
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.errors import MapError
from mcloc.kernels.jit import kernel, share

NO_WALL = 2**31 - 1
"""The squared distance to the nearest wall where the map has none."""

_FAR = 46340  # cells: the largest whole number whose square an int32 holds


@kernel
def columns(walls, distance, start, stop):  # type: ignore[no-untyped-def]
    """distance (H, W) int32: cells to the nearest wall of the same column, _FAR or less.

    walls: (H, W) uint8. The columns start … stop − 1 are done together, row by row: memory is read
    in its order, and the compiler vectorises (0.2 ns a cell).
    """
    far = np.int32(_FAR)
    one = np.int32(1)
    here, wall = distance[0][start:stop], walls[0][start:stop]
    for i in range(len(here)):
        here[i] = np.int32(0) if wall[i] else far
    for r in range(1, len(distance)):
        above, here = distance[r - 1][start:stop], distance[r][start:stop]
        wall = walls[r][start:stop]
        for i in range(len(here)):
            here[i] = np.int32(0) if wall[i] else min(above[i] + one, far)
    for r in range(len(distance) - 2, -1, -1):
        here, below = distance[r][start:stop], distance[r + 1][start:stop]
        for i in range(len(here)):
            here[i] = min(here[i], below[i] + one)


@kernel
def envelope_rows(distance, half, start, stop):  # type: ignore[no-untyped-def]
    """distance (H, W): D in place of g, the lower envelope of the parabolas (c − j)² + g(j)².

    half (W + 1,): 1/2d, and 1/2 for d = 0. There is a wall, and H² + W² ≤ _FAR².

    Parabola k of the envelope is the lowest from edge[k] to edge[k + 1], and
    edge = (g(j)² + j² − g(i)² − i²) / 2(j − i) for neighbours i < j. Rounding can move an edge past
    no cell but one at which both are equally low, so D is exact. Indices are unsigned, since signed
    ones might count from the end (3.3 instead of 4.4 ns a cell).
    """
    width = distance.shape[1]
    one = np.uint64(1)
    square = np.empty(width, np.uint32)
    lifted = np.empty(width)  # g(j)² + j²
    site = np.empty(width + 1, np.uint64)
    height = np.empty(width + 1)
    edge = np.empty(width + 1)
    nearest = np.empty(width + 1, np.uint32)
    # The first is never taken away, and higher than that of any wall wherever there is a cell.
    site[0] = 0
    height[0] = float(_FAR**2)
    edge[0] = -np.inf
    for r in range(start, stop):
        row = distance[r]
        for j in range(len(row)):
            square[j] = row[j] * row[j]
        for j in range(len(row)):
            lifted[j] = float(row[j]) * float(row[j]) + float(j) * float(j)
        top = np.uint64(0)
        for j in range(len(row)):
            if row[j] < _FAR:
                at = (lifted[j] - height[top]) * half[np.uint64(j) - site[top]]
                while at <= edge[top]:
                    top -= one
                    at = (lifted[j] - height[top]) * half[np.uint64(j) - site[top]]
                top += one
                site[top], height[top], edge[top] = j, lifted[j], at
        # Each site is put where it begins to be the nearest, and carried on from there: 0.8 ns a
        # cell, no branch that depends on the map.
        for c in range(len(nearest)):
            nearest[c] = 0
        for k in range(1, int(top) + 1):
            first = np.ceil(min(max(edge[k], 0.0), float(width)))
            nearest[np.uint64(first)] = site[k]
        near = np.uint32(0)
        for c in range(len(row)):
            near = max(near, nearest[c])
            d = c - np.int64(near)
            row[c] = d * d + square[near]


def squared_distance(walls: ArrayLike) -> NDArray[np.int32]:
    """(H, W): squared distance from the centre of each cell to that of the nearest wall, in cells²;
    NO_WALL everywhere on a map without walls.

    walls: (H, W), not 0 where a wall is. Besides the result it takes memory for a few rows. Raises
    MapError for a map of which an int32 could not hold the distances.
    """
    height, width = np.shape(walls)
    if height**2 + width**2 > _FAR**2:
        raise MapError(f"a map may be {_FAR} cells from corner to corner, got {height} × {width}")
    mask = np.require(walls, np.bool_, ["C", "W"]).view(np.uint8)
    if not mask.any():
        return np.full(mask.shape, NO_WALL, np.int32)
    distance = np.empty(mask.shape, np.int32)
    half = 0.5 / np.maximum(np.arange(width + 1), 1)
    share(lambda a, b: columns(mask, distance, a, b), width, 0.2 * mask.size)
    share(lambda a, b: envelope_rows(distance, half, a, b), height, 3.0 * mask.size)
    return distance
