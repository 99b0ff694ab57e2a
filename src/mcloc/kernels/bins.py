"""Counting occupied bins of a state space: a hash table of bin coordinates."""

import numpy as np
from numpy.typing import NDArray

from mcloc.kernels.jit import kernel

_EMPTY = np.uint64(0xFFFFFFFFFFFFFFFF)
_MIX = np.uint64(0x9E3779B97F4A7C15)


@kernel
def bin_keys(states, sides, keys):  # type: ignore[no-untyped-def]
    """keys (N,): one number for each bin, the bin's coordinates packed into 63 bits.

    Each axis gets 63 // D bits around 0: with D = 3 and bins of 0.25 m that is ± 262 km.
    """
    dimension, n = states.shape
    bits = np.uint64(63 // dimension)
    half = np.int64(1) << (np.int64(63 // dimension) - 1)
    mask = (np.uint64(1) << bits) - np.uint64(1)
    for i in range(n):
        key = np.uint64(0)
        for d in range(dimension):
            coordinate = np.int64(np.floor(states[d, i] / sides[d])) + half
            key = (key << bits) | (np.uint64(coordinate) & mask)
        keys[i] = key


@kernel
def count_distinct(keys, table, occupied, before):  # type: ignore[no-untyped-def]
    """occupied (N,): how many distinct keys were seen up to and with each one. Returns the last."""
    size = np.uint64(len(table))
    seen = before
    for i in range(len(keys)):
        slot = ((keys[i] * _MIX) >> np.uint64(20)) % size
        while table[slot] != _EMPTY and table[slot] != keys[i]:
            slot = (slot + np.uint64(1)) % size
        if table[slot] == _EMPTY:
            table[slot] = keys[i]
            seen += 1
        occupied[i] = seen
    return seen


class BinCounter:
    """How many bins of sides `sides` (D,) the states added so far occupy."""

    def __init__(self, sides: NDArray[np.float64]) -> None:
        self.sides = sides
        self.seen = 0
        self.table = np.full(4096, _EMPTY)

    def add(self, states: NDArray[np.float64]) -> NDArray[np.int64]:
        """(n,): the number of occupied bins after each column of states (D, n)."""
        n = states.shape[1]
        self._grow(2 * (self.seen + n))
        keys = np.empty(n, dtype=np.uint64)
        bin_keys(states, self.sides, keys)
        occupied = np.empty(n, dtype=np.int64)
        self.seen = count_distinct(keys, self.table, occupied, self.seen)
        return occupied

    def _grow(self, wanted: int) -> None:
        if wanted <= len(self.table):
            return
        held = self.table[self.table != _EMPTY]
        self.table = np.full(1 << (wanted - 1).bit_length(), _EMPTY)
        count_distinct(held, self.table, np.empty(len(held), dtype=np.int64), 0)
