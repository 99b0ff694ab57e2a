"""A density tree: the box around a sample set, halved until no part holds many samples, and with
them a density that is constant in each part  [Fox01 §19.3.2, Approach 2; Omohundro: Bumptrees for
efficient function, constraint and classification learning, NIPS 1990].

Everything happens in the unit cube that the root box is scaled to. There each part is a box whose
sides are 2^−k, exactly, and so is the volume that it takes. What indexes nodes and samples is
uint64: a signed index may count from the end, and to ask whether it does doubles the time of a
look-up.
"""

import numpy as np

from mcloc.kernels.jit import kernel, scalar

_LOOKED_AT = 64
"""Samples, at most, that the spread within a box is judged by: to some 10 %, at a bounded cost."""

_ABREAST = 64
"""Points that go down the tree together, so that one need not wait for another's loads."""

_STEPS = 4
"""Levels between two looks at whether all of them have arrived."""


@kernel
def to_unit_cube(states, low, side, circular, out, start, stop):  # type: ignore[no-untyped-def]
    """out (D, N) = (x − low) / side, without the whole turns of a circular axis."""
    for d in range(states.shape[0]):
        for i in range(start, stop):
            u = (states[d, i] - low[d]) / side[d]
            out[d, i] = u - np.floor(u) if circular[d] else u


@scalar
def spread(places, order, first, stop, middle, width):  # type: ignore[no-untyped-def]
    """How little of its side a box's samples fill, places[order[first … stop − 1]]: their variance
    in units of the width, or if that is less, the mean variance within the two halves in units of
    half the width; 1/12 where they fill the side evenly.

    The variance alone is largest for two hills at opposite ends, and the gap between them would
    never be cut: of two Gaussians 22 m apart, 21 % of the mass of 20,000 samples lay between them.
    """
    lower, lower_squares, below = 0.0, 0.0, 0
    upper, upper_squares, above = 0.0, 0.0, 0
    for j in range(first, stop, (stop - first - 1) // _LOOKED_AT + 1):
        v = 2.0 * (places[order[j]] - middle) / width
        if v < 0.0:
            lower += v
            lower_squares += v * v
            below += 1
        else:
            upper += v
            upper_squares += v * v
            above += 1
    n = below + above
    whole = 0.25 * ((lower_squares + upper_squares) / n - ((lower + upper) / n) ** 2)
    within = 0.0
    if below > 0:
        within += lower_squares - lower * lower / below
    if above > 0:
        within += upper_squares - upper * upper / above
    return min(within / n, whole)


@scalar
def split_at(places, middle, order, first, stop):  # type: ignore[no-untyped-def]
    """Sort order[first … stop − 1] into the samples below the middle and the others; returns where
    the others begin. No branch depends on a sample: half of them would be mispredicted.
    """
    others = first
    for j in range(first, stop):
        i = order[j]
        order[j] = order[others]
        order[others] = i
        others += places[i] < middle
    return others


@kernel
def grow(  # type: ignore[no-untyped-def]
    unit, weights, leaf, least, order, first, axis, split, child, corner, width, weight
):
    """Halve the unit cube until each part holds at most `leaf` of the samples unit (D, N), or until
    halves would be narrower than least (D,). Returns the number K of nodes, −1 if the arrays hold
    fewer than that.

    A box is halved along the axis on which its samples are most crowded, see `spread`. The boxes so
    take the shape of each hill, whatever the units. One axis after the other would not: with 10,000
    poses in a corridor, the mean |p̂/p − 1| was 0.61 instead of 0.34.

    order (N,): 0 … N − 1, sorted so that each box has its samples in a row, from first (K, 2)[:, 0]
    to before first[:, 1]. axis, split, child (K,): a point goes on to child, or to child + 1 where
    its coordinate on the axis is not below split; a leaf is its own child, split at NaN. corner,
    width (K, D): of the boxes. weight (K,): of the samples in a leaf, 0 at other nodes.
    """
    dimension, n = unit.shape
    first[0, 0], first[0, 1] = 0, n
    corner[0], width[0] = 0.0, 1.0
    nodes, k = 1, 0
    while k < nodes:  # the nodes are their own queue: children come last
        a, b = first[k, 0], first[k, 1]
        along, smallest = -1, np.inf
        if b - a > leaf:
            for d in range(dimension):
                if width[k, d] >= 2.0 * least[d]:
                    crowded = spread(
                        unit[d], order, a, b, corner[k, d] + 0.5 * width[k, d], width[k, d]
                    )
                    if crowded < smallest:
                        along, smallest = d, crowded
        if along < 0:
            axis[k], split[k], child[k] = 0, np.nan, k  # not even ∞ is above NaN
            total = 0.0
            for j in range(a, b):
                total += weights[order[j]]
            weight[k] = total
        else:
            if nodes + 2 > len(axis):
                return -1
            half = 0.5 * width[k, along]
            middle = corner[k, along] + half
            axis[k], split[k], child[k], weight[k] = along, middle, nodes, 0.0
            m = split_at(unit[along], middle, order, a, b)
            first[nodes, 0], first[nodes, 1] = a, m
            first[nodes + 1, 0], first[nodes + 1, 1] = m, b
            for c in range(nodes, nodes + 2):
                for d in range(dimension):
                    corner[c, d] = corner[k, d]
                    width[c, d] = width[k, d]
                width[c, along] = half
            corner[nodes + 1, along] = middle
            nodes += 2
        k += 1
    return nodes


@kernel
def look_up(unit, axis, split, child, values, out, start, stop):  # type: ignore[no-untyped-def]
    """out (N,): the value of the leaf that each point unit (D, N) lies in; −inf outside the cube,
    NaN for NaN.
    """
    dimension = unit.shape[0]
    node = np.empty(_ABREAST, np.uint64)
    for begin in range(start, stop, _ABREAST):
        n = min(_ABREAST, stop - begin)
        node[:] = 0
        on_the_way = True
        while on_the_way:
            for _ in range(_STEPS):
                for j in range(n):
                    k = node[j]
                    node[j] = child[k] + (unit[axis[k], begin + j] >= split[k])
            on_the_way = False
            for j in range(n):
                on_the_way |= child[node[j]] != node[j]
        for j in range(n):
            value = values[node[j]]
            for d in range(dimension):
                u = unit[d, begin + j]
                if u != u:
                    value = np.nan
                elif u < 0.0 or u > 1.0:
                    value = -np.inf
            out[begin + j] = value
