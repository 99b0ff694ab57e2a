"""p'(x) with fewer leaves than p(x): sibling leaves become one, first those for which the least of
D(p ‖ p') is lost. Merging two leaves of masses a and b, of the same volume, loses

    d = a log(2a / (a + b)) + b log(2b / (a + b))

and what several mergers lose adds up, because p' is constant wherever it is merged.
"""

import heapq
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import xlogy

from mcloc.density_tree import DensityTree
from mcloc.errors import ConfigError


def compressed(tree: DensityTree, most: int) -> DensityTree:
    """The tree with at most `most` leaves; itself where it has no more than that. Raises
    ConfigError unless most >= 1.
    """
    if most < 1:
        raise ConfigError(f"a density tree has at least one leaf, not {most}")
    nodes = np.arange(len(tree.child), dtype=np.uint64)
    leaf = tree.child == nodes
    surplus = int(leaf.sum()) - most
    if surplus <= 0:
        return tree
    lost = merger_costs(tree)
    return _cut(tree, _cheapest(tree.child.astype(np.intp), leaf, lost, surplus))


def merger_costs(tree: DensityTree) -> NDArray[np.float64]:
    """(K,): d of the two halves of each node, in nats; 0 at leaves."""
    child, mass = tree.child.astype(np.intp), _summed(tree, tree.mass)
    inner = child != np.arange(len(child))
    halves = np.stack([mass[child[inner]], mass[child[inner] + 1]])
    both = halves.sum(axis=0)
    lost = np.zeros(len(child))
    lost[inner] = (xlogy(halves, 2.0 * halves) - xlogy(halves, both)).sum(axis=0)
    return lost


def _summed(tree: DensityTree, of_leaves: NDArray[np.float64]) -> NDArray[np.float64]:
    """(K,): at each node the sum over the leaves below it. Children come after their parents."""
    sums, child = of_leaves.tolist(), tree.child.tolist()
    for k in range(len(sums) - 1, -1, -1):
        if child[k] != k:
            sums[k] = sums[child[k]] + sums[child[k] + 1]
    return np.array(sums)


def _cheapest(
    child: NDArray[np.intp], leaf: NDArray[np.bool_], lost: NDArray[np.float64], n: int
) -> NDArray[np.intp]:
    """(n,): the inner nodes to make leaves of, one after the other."""
    parent = np.full(len(child), -1)
    inner = np.flatnonzero(~leaf)
    parent[child[inner]] = parent[child[inner] + 1] = inner
    whole = inner[leaf[child[inner]] & leaf[child[inner] + 1]]
    heap = list(zip(lost[whole].tolist(), whole.tolist(), strict=True))
    heapq.heapify(heap)
    ended, first, above, costs = leaf.tolist(), child.tolist(), parent.tolist(), lost.tolist()
    merged = []
    for _ in range(n):
        _, k = heapq.heappop(heap)
        ended[k] = True
        merged.append(k)
        up = above[k]
        if up >= 0 and ended[first[up]] and ended[first[up] + 1]:
            heapq.heappush(heap, (costs[up], up))
    return np.array(merged)


def _cut(tree: DensityTree, merged: NDArray[np.intp]) -> DensityTree:
    """With these nodes as leaves, and without what is below them."""
    child, weight = tree.child.astype(np.intp), _summed(tree, tree.weight)
    nodes = np.arange(len(child))
    below = child.copy()
    below[merged] = merged
    kept = np.zeros(len(child), dtype=np.bool_)
    kept[0] = True
    for k, first in enumerate(below.tolist()):
        if first != k and kept[k]:
            kept[first : first + 2] = True
    ends = below == nodes
    place = np.cumsum(kept) - 1
    return replace(
        tree,
        axis=np.where(ends, 0, tree.axis)[kept].astype(np.uint64),
        split=np.where(ends, np.nan, tree.split)[kept],
        child=place[below[kept]].astype(np.uint64),
        corner=tree.corner[kept],
        width=tree.width[kept],
        weight=np.where(ends, weight, 0.0)[kept],
    )
