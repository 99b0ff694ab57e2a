"""Which particle a tooth meets: the first whose cumulative weight is above it, by indexed search
[Chen, Asau: On generating random variates from an empirical distribution, AIIE Transactions 6,
1974].

A guide says for each of N equal parts of the weight at which particle it begins. From there one
particle more is looked at in the mean, instead of log N of them by bisection (4 instead of 60 ns).
"""

import numpy as np

from mcloc.kernels.jit import kernel, scalar

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


@kernel
def first_above(weights, scale, offset, out):  # type: ignore[no-untyped-def]
    """out (n,): for each k the first particle whose cumulative weight · scale > k + offset.

    weights (N,): scale · Σ ≤ n. With scale = n / Σ these are the particles that a comb of n teeth
    meets. Each particle is put where it begins and carried on from there, so that no branch depends
    on the weights.
    """
    out[:] = 0
    n, cumulative, _last = len(out), 0.0, 0
    for i in range(len(weights)):
        begins = np.ceil(cumulative * scale - offset)
        weighs = weights[i] > 0.0
        if weighs and begins < n:
            out[np.int64(begins) if begins > 0.0 else 0] = i
        cumulative += weights[i]
    before = 0
    for k in range(n):
        before = out[k] if out[k] > before else before
        out[k] = before


@scalar
def _met(tooth, cumulative, last, guide):  # type: ignore[no-untyped-def]
    """The particle that a tooth in [0, 1] meets, none after the last that weighs anything."""
    at = tooth * cumulative[-1]
    i = guide[np.int64(tooth * (len(guide) - 1))]
    while i > 0 and cumulative[i - 1] > at:  # rounding has put the guide a particle too far
        i -= 1
    while i < last and cumulative[i] <= at:
        i += 1
    return i if i < last else last


@kernel
def ancestors_of(teeth, cumulative, last, guide, out):  # type: ignore[no-untyped-def]
    """out (n,): the particles that the teeth (n,) meet."""
    for j in range(len(teeth)):
        out[j] = _met(teeth[j], cumulative, last, guide)


@kernel
def ancestors_of_golden_comb(offset, first, cumulative, last, guide, out):  # type: ignore[no-untyped-def]
    """out: those that the teeth frac(offset + j (√5 − 1)/2) meet, j = first, first + 1 …"""
    for j in range(len(out)):
        tooth = offset + (first + j) * GOLDEN
        out[j] = _met(tooth - np.floor(tooth), cumulative, last, guide)
