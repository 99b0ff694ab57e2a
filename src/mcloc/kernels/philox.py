"""Philox4x32-10, a counter-based generator [Salmon, Moraes, Dror, Shaw: Parallel random numbers:
as easy as 1, 2, 3, SC'11, §4.3].

Four 32-bit words for each 128-bit counter and 64-bit key. The counter is (particle index, stream,
step, part), the key is the seed: no word depends on the order in which others are computed.
"""

import numpy as np

from mcloc.kernels.jit import kernel, scalar

_M0 = np.uint64(0xD2511F53)
_M1 = np.uint64(0xCD9E8D57)
_W0 = np.uint64(0x9E3779B9)
_W1 = np.uint64(0xBB67AE85)
_LOW = np.uint64(0xFFFFFFFF)
_32 = np.uint64(32)


@scalar
def philox(c0, c1, c2, c3, key):  # type: ignore[no-untyped-def]
    """The four words (uint64 holding 32 bits) of one counter."""
    # The masks tell the compiler that all products are of 32 bits, which it has vectors for.
    a, b = np.uint64(c0) & _LOW, np.uint64(c1) & _LOW
    c, d = np.uint64(c2) & _LOW, np.uint64(c3) & _LOW
    k0 = np.uint64(key) & _LOW
    k1 = np.uint64(key) >> _32
    for _ in range(10):
        p0 = _M0 * a
        p1 = _M1 * c
        a = (p1 >> _32) ^ b ^ k0
        b = p1 & _LOW
        c = (p0 >> _32) ^ d ^ k1
        d = p0 & _LOW
        k0 = (k0 + _W0) & _LOW
        k1 = (k1 + _W1) & _LOW
    return a, b, c, d


@kernel
def fill_words(out, first, stream, step, part, key, start, stop):  # type: ignore[no-untyped-def]
    """out (4, N) uint32: the words of the particles first + start … first + stop − 1."""
    # Rows cut to size first: a loop from 0 over them is one that the compiler vectorises.
    w, x, y, z = out[0, start:stop], out[1, start:stop], out[2, start:stop], out[3, start:stop]
    for i in range(len(w)):
        a, b, c, d = philox(first + start + i, stream, step, part, key)
        w[i], x[i], y[i], z[i] = np.uint32(a), np.uint32(b), np.uint32(c), np.uint32(d)
