"""Clusters of occupied bins: hills of a smoothed histogram, joined where no real valley parts them
[Chazal, Guibas, Oudot, Skraba: Persistence-based clustering in Riemannian manifolds, J. ACM
2013].
"""

import numpy as np

from mcloc.kernels.jit import kernel


@kernel
def find_neighbours(keys, coordinates, offsets, periods, strides, out):  # type: ignore[no-untyped-def]
    """out (K, M): the index of the bin at each offset (M, D) from each bin (D, K), −1 where it is
    empty.

    keys (K,): sorted, Σ_d coordinate_d · stride_d. offsets: each at the other end of the table from
    its opposite. periods (D,): bins around a circular axis, 0 for
    a straight one.
    """
    n, count = len(keys), len(offsets)
    for m in range(
        (count + 1) // 2
    ):  # the other half are the same pairs, seen from their other end
        near = 0  # keys rise, so do those looked for, but at the seam of a circular axis
        for k in range(n):
            out[k, m] = out[k, count - 1 - m] = -1
        for k in range(n):
            key = np.int64(0)
            for d in range(len(periods)):
                at = coordinates[d, k] + offsets[m, d]
                if periods[d] > 0:
                    at %= periods[d]
                key += at * strides[d]
            steps = 0
            while near < n and keys[near] < key and steps < 8:
                near += 1
                steps += 1
            if near == n or keys[near] < key or (near > 0 and keys[near - 1] >= key):
                near = _bisected(keys, key)
            if near < n and keys[near] == key:
                out[k, m], out[near, count - 1 - m] = near, k


@kernel
def _bisected(keys, key):  # type: ignore[no-untyped-def]
    """The first of the sorted keys that is not below the key (half as long to compile as
    NumPy's).
    """
    low, high = 0, len(keys)
    while low < high:
        middle = (low + high) // 2
        if keys[middle] < key:
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def smooth(mass, neighbours, kernel_weights, out):  # type: ignore[no-untyped-def]
    """out (K,): the mass of each bin and its neighbours, weighted by the offset's weight (M,)."""
    for k in range(len(mass)):
        total = 0.0
        for m in range(neighbours.shape[1]):
            if neighbours[k, m] >= 0:
                total += kernel_weights[m] * mass[neighbours[k, m]]
        out[k] = total


@kernel
def join_hills(order, density, neighbours, valley, root):  # type: ignore[no-untyped-def]
    """root (K,): for each bin the bin at the top of its hill.

    Bins come in order of falling density. One that touches no hill starts one; one that touches
    several belongs to the highest, and joins to it every hill that rises less than 1/valley above
    this saddle.
    """
    root[:] = -1
    for k in order:
        best = -1
        for m in range(neighbours.shape[1]):
            j = neighbours[k, m]
            if j >= 0 and root[j] >= 0:
                top = _top(root, j)
                if (
                    best < 0
                    or density[top] > density[best]
                    or (density[top] == density[best] and top < best)
                ):
                    best = top
        if best < 0:
            root[k] = k
            continue
        root[k] = best
        for m in range(neighbours.shape[1]):
            j = neighbours[k, m]
            if j >= 0 and root[j] >= 0:
                top = _top(root, j)
                if top != best and density[k] >= valley * density[top]:
                    root[top] = best
    for k in range(len(root)):
        root[k] = _top(root, k)


@kernel
def _top(root, k):  # type: ignore[no-untyped-def]
    while root[k] != k:
        root[k] = root[root[k]]
        k = root[k]
    return k
