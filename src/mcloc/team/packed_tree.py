"""A density tree as bytes: a bounded number of them, and data only. Little-endian,

    space  1   1 places in the plane, 2 poses in the plane
    leaves 2   n, 1 … MOST_LEAVES
    floor  8   ε in [0, 1)
    root   16  for each axis: its low end and its side
    nodes  1   for each of the 2n − 1 in preorder: the axis that it is halved along, or LEAF
    masses 4   for each of the n leaves in preorder: a float32; they sum to 1

A box is halved in the middle, so that nothing need be said of where.
"""

import struct

import numpy as np
from numpy.typing import NDArray

from mcloc.density import FAR
from mcloc.density_tree import DensityTree
from mcloc.errors import MessageError
from mcloc.statespace import PLANE, SE2, StateSpace
from mcloc.team.compression import compressed

MOST_LEAVES = 512
"""A ring of poses from 5,000 particles has 591 leaves. With 512 of them D(p ‖ p') is 0.0025 nats,
with 256 it is 0.16, with 128 it is 0.50: as much as 5,000 samples tell of it.
"""

LEAF = 255
SPACES = {1: PLANE, 2: SE2}

_HEAD = struct.Struct("<BHd")
_SMALLEST, _LARGEST = 1e-6, 4.0 * FAR  # sides, m or rad
_HALVINGS = 40  # of one axis: 40,000 km to parts of 36 µm
_FARTHEST_CUT = 4.0 * np.pi  # rad
_ROUNDING = 1e-4  # of a sum of float32


def most_bytes(dimension: int, most_leaves: int = MOST_LEAVES) -> int:
    """How long a packed tree can be."""
    return _HEAD.size + 16 * dimension + (2 * most_leaves - 1) + 4 * most_leaves


def packed(tree: DensityTree, most_leaves: int = MOST_LEAVES) -> bytes:
    """The tree, compressed to most_leaves leaves. Raises MessageError for one of another space than
    those above.
    """
    code = next((code for code, space in SPACES.items() if space == tree.space), None)
    if code is None:
        raise MessageError(f"no message holds a density over {', '.join(tree.space.axes)}")
    tree = compressed(tree, min(most_leaves, MOST_LEAVES))
    nodes, order = _preorder(tree)
    n = (len(order) + 1) // 2
    root = np.stack([tree.low, tree.side], axis=1).astype("<f8").tobytes()
    masses = tree.weight[order][nodes == LEAF].astype("<f4").tobytes()
    return b"".join((_HEAD.pack(code, n, tree.floor), root, nodes.tobytes(), masses))


def unpacked(data: bytes, *spaces: StateSpace) -> DensityTree:
    """The density over one of these spaces that the bytes are of. Raises MessageError for anything
    else, which names why in a few words; it never takes more memory than MOST_LEAVES leaves do.
    """
    if len(data) < _HEAD.size:
        raise MessageError("tree of the wrong length")
    code, n, floor = _HEAD.unpack_from(data)
    space = SPACES.get(code)
    if space is None or space not in spaces:
        raise MessageError("tree of another space")
    if not 1 <= n <= MOST_LEAVES:
        raise MessageError("tree of too many leaves, or none")
    d = space.dimension
    if len(data) != most_bytes(d, n):
        raise MessageError("tree of the wrong length")
    if not 0.0 <= floor < 1.0:
        raise MessageError("floor of a tree not in [0, 1)")
    root = np.frombuffer(data, "<f8", 2 * d, _HEAD.size).reshape(d, 2).astype(np.float64)
    low, side = _checked_root(root, space)
    nodes = np.frombuffer(data, np.uint8, 2 * n - 1, _HEAD.size + 16 * d)
    told = np.frombuffer(data, "<f4", n, _HEAD.size + 16 * d + 2 * n - 1)
    if not (np.isfinite(told).all() and (told >= 0.0).all()):
        raise MessageError("mass of a leaf NaN, infinite or negative")
    masses = told.astype(np.float64)  # now that it holds no NaN, of which NumPy may warn
    total = masses.sum()
    if not abs(total - 1.0) < _ROUNDING:
        raise MessageError("masses of a tree that do not sum to 1")
    return _grown(space, floor, low, side, nodes.tolist(), masses / total)


def _preorder(tree: DensityTree) -> tuple[NDArray[np.uint8], NDArray[np.intp]]:
    """(K,): what each node is on the wire, and its index in the tree."""
    child, axis = tree.child.tolist(), tree.axis.tolist()
    kinds, order, waiting = [], [], [0]
    while waiting:
        k = waiting.pop()
        order.append(k)
        kinds.append(LEAF if child[k] == k else axis[k])
        if child[k] != k:
            waiting += [child[k] + 1, child[k]]
    return np.array(kinds, dtype=np.uint8), np.array(order)


def _checked_root(
    root: NDArray[np.float64], space: StateSpace
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """low, side (D,). The circle of a circular axis is whole, whatever its last digit."""
    low, side = np.ascontiguousarray(root.T)
    circular = np.array(space.circular)
    if not (
        np.isfinite(root).all()
        and (np.abs(low) < np.where(circular, _FARTHEST_CUT, 2.0 * FAR)).all()
        and ((side >= _SMALLEST) & (side <= _LARGEST)).all()
        and np.allclose(side[circular], 2.0 * np.pi, rtol=0.0, atol=1e-9)
    ):
        raise MessageError("box of a tree that cannot be")
    side[circular] = 2.0 * np.pi
    return low, side


def _grown(
    space: StateSpace,
    floor: float,
    low: NDArray[np.float64],
    side: NDArray[np.float64],
    kinds: list[int],
    masses: NDArray[np.float64],
) -> DensityTree:
    """The tree of nodes in preorder, each pair of halves side by side as `DensityTree` wants it."""
    nodes, d = len(kinds), space.dimension
    axis, child = np.zeros((2, nodes), dtype=np.uint64)
    split, weight = np.full(nodes, np.nan), np.zeros(nodes)
    corner, width = np.zeros((nodes, d)), np.ones((nodes, d))
    waiting, taken, told = [0], 1, iter(masses.tolist())
    for kind in kinds:
        if not waiting:
            raise MessageError("tree that is not whole")
        k = waiting.pop()
        if kind == LEAF:
            mass = next(told, None)
            if mass is None:
                raise MessageError("tree that is not whole")
            child[k], weight[k] = k, mass
            continue
        if kind >= d or taken + 2 > nodes:
            raise MessageError("tree that is not whole" if kind < d else "axis that is none")
        half = 0.5 * width[k, kind]
        if half < 2.0**-_HALVINGS:
            raise MessageError("box of a tree halved too often")
        axis[k], split[k], child[k] = kind, corner[k, kind] + half, taken
        corner[taken : taken + 2], width[taken : taken + 2] = corner[k], width[k]
        width[taken : taken + 2, kind] = half
        corner[taken + 1, kind] += half
        waiting += [taken + 1, taken]
        taken += 2
    if waiting:
        raise MessageError("tree that is not whole")
    return DensityTree(space, floor, low, side, axis, split, child, corner, width, weight)
