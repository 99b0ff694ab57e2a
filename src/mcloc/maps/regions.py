"""Regions of free space: hills of the distance to what is not free, parted at doors, and pieces of
them.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from mcloc.kernels.clusters import join_hills

DOOR = 0.7  # a passage that is narrower than this share of both sides parts two regions
ELONGATED = 3.0  # × as long as wide: a corridor
LONGEST = 1.5, 3.0  # pieces that corridors and rooms may be long before they are cut

Cells = NDArray[np.intp]

_AROUND = ((0, 1), (1, 0), (0, -1), (-1, 0))


def hills(clearance: NDArray[np.float64], standing: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(height, width): which hill of the clearance each standing cell belongs to, −1 elsewhere."""
    height, width = standing.shape
    number = np.full((height + 2, width + 2), -1, dtype=np.int64)
    number[1:-1, 1:-1][standing] = np.arange(np.count_nonzero(standing))
    neighbours = np.stack(
        [number[1 + r : height + 1 + r, 1 + c : width + 1 + c][standing] for r, c in _AROUND],
        axis=1,
    )
    density = clearance[standing]
    root = np.empty(len(density), dtype=np.int64)
    join_hills(np.argsort(-density, kind="stable"), density, neighbours, DOOR, root)
    hill = np.full(standing.shape, -1, dtype=np.int64)
    hill[standing] = np.unique(root, return_inverse=True)[1]
    return hill


def cut(
    clearance: NDArray[np.float64], hill: NDArray[np.int64], cell: float, piece: float
) -> NDArray[np.int64]:
    """(height, width): the pieces of hills, −1 elsewhere."""
    node = np.full(hill.shape, -1, dtype=np.int64)
    count = 0
    for cells in _groups(hill):
        waiting = [_Shape(clearance, cells, cell)]
        while waiting:
            shape = waiting.pop()
            n = round(shape.length / piece) if shape.too_long(piece) else 1
            if n < 2:
                node[shape.cells] = count
                count += 1
                continue
            slices = np.minimum((shape.along / shape.length * n).astype(np.intp), n - 1)
            for k in range(n):
                part = tuple(axis[slices == k] for axis in shape.cells)
                waiting += [_Shape(clearance, whole, cell) for whole in _connected(part)]
    return node


class _Shape:
    """A region: its cells, how far each is from one end on ways within it, and how long and wide it
    is, m.
    """

    def __init__(
        self, clearance: NDArray[np.float64], cells: tuple[Cells, ...], cell: float
    ) -> None:
        self.cells = cells
        end = int(_fronts(cells, 0).argmax())
        self.along = cell * _fronts(cells, end)
        self.length = float(self.along.max()) + cell
        self.width = 2.0 * float(clearance[cells].max())

    @property
    def elongated(self) -> bool:
        return self.length >= ELONGATED * self.width

    def too_long(self, piece: float) -> bool:
        """Whether it has to be cut."""
        corridor, room = LONGEST
        return self.length > (corridor if self.elongated else room) * piece


def _fronts(cells: tuple[Cells, ...], start: int) -> Cells:
    """(n,): steps within the cells from one of them to each: to 4 and to 8 neighbours in turn,
    which makes octagons of circles.
    """
    low = [int(axis.min()) - 1 for axis in cells]
    height, width = (int(axis.max()) - b + 2 for axis, b in zip(cells, low, strict=True))
    at = (cells[0] - low[0]) * width + cells[1] - low[1]
    waiting = np.zeros(height * width, dtype=np.bool_)
    waiting[at] = True
    steps: Cells = np.zeros(height * width, dtype=np.intp)
    first = np.empty_like(steps)
    straight = np.array([1, -1, width, -width])
    around = np.append(straight, [width + 1, width - 1, 1 - width, -1 - width])
    front, k = at[start : start + 1], 0
    while len(front):
        waiting[front] = False
        steps[front] = k
        k += 1
        reached = (front[:, None] + (straight if k % 2 else around)).ravel()
        reached = reached[waiting[reached]]
        first[reached] = np.arange(len(reached))
        front = reached[first[reached] == np.arange(len(reached))]  # each once
    found: Cells = steps[at]
    return found


def _groups(node: NDArray[np.int64]) -> list[tuple[Cells, ...]]:
    """The cells (rows, columns) of each node, in order."""
    flat = node.ravel()
    order = np.argsort(flat, kind="stable")[np.count_nonzero(flat < 0) :]
    ends = np.cumsum(np.bincount(flat[order]))[:-1] if len(order) else np.empty(0, dtype=np.intp)
    parts = np.split(order, ends) if len(order) else []
    return [np.unravel_index(part, node.shape) for part in parts]


def _connected(cells: tuple[Cells, ...]) -> list[tuple[Cells, ...]]:
    """The connected parts of these cells."""
    if len(cells[0]) == 0:
        return []
    low = [int(axis.min()) for axis in cells]
    mask = np.zeros([int(axis.max()) - b + 1 for axis, b in zip(cells, low, strict=True)])
    at = tuple(axis - b for axis, b in zip(cells, low, strict=True))
    mask[at] = 1.0
    part = label(mask)[0][at]
    return [tuple(axis[part == k] for axis in cells) for k in range(1, int(part.max()) + 1)]


def passages(
    clearance: NDArray[np.float64], node: NDArray[np.int64]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """(E, 2): pairs of nodes that touch, sorted; (E,) the largest clearance between them, m."""
    pairs, between = [], []
    for a, b in (np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:]):
        touch = (node[a] != node[b]) & (node[a] >= 0) & (node[b] >= 0)
        pairs.append(np.sort(np.stack([node[a][touch], node[b][touch]], axis=1), axis=1))
        between.append(np.minimum(clearance[a][touch], clearance[b][touch]))
    edges, which = np.unique(np.concatenate(pairs), axis=0, return_inverse=True)
    widest = np.zeros(len(edges))
    np.maximum.at(widest, which.ravel(), np.concatenate(between))
    return edges.astype(np.intp), widest


def merged(
    clearance: NDArray[np.float64], node: NDArray[np.int64], cell: float, least: float
) -> NDArray[np.int64]:
    """Small nodes as part of the neighbour with the widest passage, smallest first; those without
    any as −1. Numbered anew.
    """
    count = int(node.max()) + 1
    size = np.bincount(node[node >= 0], minlength=count) * cell**2
    widths: list[dict[int, float]] = [{} for _ in range(count)]
    for (a, b), width in zip(*(part.tolist() for part in passages(clearance, node)), strict=True):
        widths[a][b] = widths[b][a] = width
    into = np.arange(count)
    while (small := np.flatnonzero(size < least)).size:
        k = int(small[np.argmin(size[small])])
        if widths[k]:
            other = max(widths[k], key=lambda n: (widths[k][n], -n))
            into[into == k] = other
            size[other] += size[k]
            for n, width in widths[k].items():
                del widths[n][k]
                if n != other:
                    wider = max(width, widths[n].get(other, 0.0))
                    widths[n][other] = widths[other][n] = wider
        else:
            into[into == k] = -1
        size[k] = np.inf
    kept, numbered = np.unique(into, return_inverse=True)
    numbered = numbered - (1 if len(kept) and kept[0] < 0 else 0)
    return np.where(node >= 0, numbered[node], -1) if count else node
