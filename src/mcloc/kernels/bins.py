"""Occupied bins of a state space, numbered as they are found: a hash table of their coordinates.

The coordinates of a bin are packed into one number, 62 // D bits for each axis around 0: with D = 3
and bins of 0.25 m that is ± 131 km.
"""

import numpy as np
from numpy.typing import NDArray

from mcloc.kernels.jit import kernel, share

_MIX = np.uint64(0x9E3779B97F4A7C15)  # 2⁶⁴ / golden ratio: Fibonacci hashing
_EMPTY = -1
_BITS = 62


@kernel
def bin_keys(states, per_side, around, keys, start, stop):  # type: ignore[no-untyped-def]
    """keys (N,) int64: the packed coordinates of the bin of each state (D, N).

    per_side (D,): bins per m or rad. around (D,): how many bins make a circle along a circular
    axis, 0 along a straight one.
    """
    dimension = states.shape[0]
    bits = np.int64(_BITS // dimension)
    half = np.int64(1) << (bits - np.int64(1))
    mask = (np.int64(1) << bits) - np.int64(1)
    out = keys[start:stop]
    out[:] = 0
    for d in range(dimension):
        x, per, circle = states[d, start:stop], per_side[d], around[d]
        for i in range(len(x)):
            at = np.floor(x[i] * per)
            at = at - circle * np.floor(at / circle) if circle > 0.0 else at
            out[i] = (out[i] << bits) | ((np.int64(at) + half) & mask)


@kernel
def number_bins(keys, first, table, distinct, seen, labels, known):  # type: ignore[no-untyped-def]
    """labels (N,) int32: the number of each key, in the order of their first sight. Returns how
    many keys are known by now, and up to which one it came: it stops where the table is half full.

    table: int32 of a power of two, _EMPTY or a number. distinct, seen: the keys by number, `known`
    of which have been seen before, and where among `keys` each was.
    """
    shift, size = np.uint64(64), len(table)
    while size > 1:
        size //= 2
        shift -= np.uint64(1)
    around = np.int64(len(table) - 1)
    last_key, last_label = np.int64(-1), np.int32(-1)
    for i in range(first, len(keys)):
        key = keys[i]
        if key != last_key:  # children of one ancestor lie side by side
            slot = np.int64((np.uint64(key) * _MIX) >> shift)
            label = table[slot]
            while label != _EMPTY and distinct[label] != key:
                slot = (slot + 1) & around
                label = table[slot]
            if label == _EMPTY:
                if 2 * known == len(table):
                    return known, i
                label = np.int32(known)
                table[slot], distinct[known], seen[known] = label, key, i
                known += 1
            last_key, last_label = key, label
        labels[i] = last_label
    return known, len(keys)


@kernel
def first_enough(labels, known, numbered, least):  # type: ignore[no-untyped-def]
    """The first of the particles labelled (n,) by which there are as many as their bins ask for,
    −1 for none.

    known: bins before them; numbered: particles before them. least (…,): how many particles known,
    known + 1 … bins ask for.
    """
    occupied = known
    for i in range(len(labels)):
        if labels[i] >= occupied:
            occupied = labels[i] + 1
        if numbered + i + 1 >= least[occupied - known]:
            return i
    return -1


class Bins:
    """The bins that the states added so far occupy.

    sides (D,): of a bin. around (D,): how many make a circle, see `bin_keys`. known: how many there
    are. strides (D,): what a step along each axis adds to a key. first (≥ known,): for each bin the
    first column there, of the states with which it was found. Coordinates that do not fit are
    wrapped: bins that far apart may be taken for one.
    """

    def __init__(self, sides: NDArray[np.float64], around: NDArray[np.float64]) -> None:
        self.sides, self.around = sides, around
        self._shifts = _BITS // len(sides) * np.arange(len(sides))[::-1, None]
        self.strides = np.left_shift(1, self._shifts[:, 0])
        self.known = 0
        self._table = np.full(1024, _EMPTY, dtype=np.int32)
        self._distinct = np.empty(512, dtype=np.int64)
        self.first = np.empty(512, dtype=np.intp)

    def add(self, states: NDArray[np.float64]) -> NDArray[np.int32]:
        """(n,): the number of the bin of each column of states (D, n)."""
        n, per_side = states.shape[1], 1.0 / self.sides
        keys, labels = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int32)
        share(lambda a, b: bin_keys(states, per_side, self.around, keys, a, b), n, 3.0 * n)
        done = self._number(keys, 0, labels)
        while done < n:
            self._grow()
            done = self._number(keys, done, labels)
        return labels

    def sorted(self) -> tuple[NDArray[np.intp], NDArray[np.int64], NDArray[np.int64]]:
        """The numbers (K,) of the bins by rising key; their keys (K,), 0 for the bin at the origin;
        their coordinates (D, K), Σ coordinate · stride = key.
        """
        order = np.argsort(self._distinct[: self.known])
        keys = self._distinct[order]
        bits = _BITS // len(self.sides)
        half = 1 << (bits - 1)
        at = ((keys >> self._shifts) & ((1 << bits) - 1)) - half
        return order, keys - half * int(self.strides.sum()), at

    def _number(self, keys: NDArray[np.int64], done: int, labels: NDArray[np.int32]) -> int:
        self.known, done = number_bins(
            keys, done, self._table, self._distinct, self.first, labels, self.known
        )
        return done

    def _grow(self) -> None:
        held, first, self.known = self._distinct[: self.known], self.first[: self.known], 0
        self._table = np.full(4 * len(self._table), _EMPTY, dtype=np.int32)
        self._distinct = np.empty(len(self._table) // 2, dtype=np.int64)
        self.first = np.empty(len(self._distinct), dtype=np.intp)
        self._number(held, 0, np.empty(len(held), dtype=np.int32))
        self.first[: self.known] = first
