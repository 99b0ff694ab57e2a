"""Σ_k |ring_{s+k} − z_k| for every turn s of a ring, and the turn where it is least.

Each term is the same loop over all turns, of whole numbers of 16 bits: 0.05 … 0.06 ns for a term
and turn.
"""

import numpy as np

from mcloc.kernels.jit import kernel, scalar

_LANES = 16  # turns are a multiple of it, or the rest of each loop takes as long as two of them


@kernel
def best_turns(rings, sectors, values, turns, apart, start, stop):  # type: ignore[no-untyped-def]
    """turns, apart (n,) int32: the turn of each ring at which it is most like the values, the first
    of several, and the sum of the absolute differences there.

    rings: (n, K) uint8. sectors: (B,), 0 … K − 1, where on the ring each value stands; values: (B,)
    int16, 0 … 255. B ≤ 257; of none all turns are alike.
    """
    around, n = rings.shape[1], len(sectors)
    padded = -(-around // _LANES) * _LANES
    twice, total = np.empty(around + padded, np.int16), np.empty(padded, np.uint16)
    for i in range(start, stop):
        ring = rings[i]
        for s in range(around):
            twice[s] = ring[s]
        for s in range(padded):
            twice[around + s], total[s] = twice[s], 0
        whole = n - n % 4
        for j in range(0, whole, 4):  # four at a time: half as many sums are stored and read again
            a, b, c, d = sectors[j], sectors[j + 1], sectors[j + 2], sectors[j + 3]
            of_a, of_b = twice[a : a + padded], twice[b : b + padded]
            of_c, of_d = twice[c : c + padded], twice[d : d + padded]
            at_a, at_b, at_c, at_d = values[j], values[j + 1], values[j + 2], values[j + 3]
            for s in range(padded):
                two = _apart(of_a[s], at_a) + _apart(of_b[s], at_b)
                total[s] = np.uint16(total[s] + two + _apart(of_c[s], at_c) + _apart(of_d[s], at_d))
        for j in range(whole, n):
            turned, value = twice[sectors[j] : sectors[j] + padded], values[j]
            for s in range(padded):
                total[s] = np.uint16(total[s] + _apart(turned[s], value))
        least = total[0]
        for s in range(around):
            least = total[s] if total[s] < least else least
        turn = 0
        while total[turn] != least:
            turn += 1
        turns[i], apart[i] = turn, least


@scalar
def _apart(a, b):  # type: ignore[no-untyped-def]
    """|a − b| of two int16 from 0 to 255."""
    difference = np.int16(a - b)
    return np.int16(difference if difference > 0 else -difference)
