"""Standard normals from random words: Box–Muller in single precision, for 16 particles at once.

What noise is lost to rounding, some 10⁻⁷ of it, no filter can tell; half the width and polynomials
of half the degree take 2.5 instead of 5.6 ns for four normals. The polynomials are those of Cephes
(logf.c, sinf.c, cosf.c), the tests hold them to 10⁻⁷.
"""

import numpy as np
from numpy.typing import NDArray

from mcloc.kernels.jit import kernel, scalar
from mcloc.kernels.philox import fill_words

_F = np.float32

_P0, _P1, _P2 = _F(7.0376836292e-2), _F(-1.1514610310e-1), _F(1.1676998740e-1)
_P3, _P4, _P5 = _F(-1.2420140846e-1), _F(1.4249322787e-1), _F(-1.6668057665e-1)
_P6, _P7, _P8 = _F(2.0000714765e-1), _F(-2.4999993993e-1), _F(3.3333331174e-1)
_LN2_HIGH, _LN2_LOW = _F(0.693359375), _F(-2.12194440e-4)
_ROOT_HALF, _MANTISSA = np.int32(0x3F3504F3), np.int32(23)  # the bits of √½

_S1, _S2, _S3 = _F(-1.9515295891e-4), _F(8.3321608736e-3), _F(-1.6666654611e-1)
_C1, _C2, _C3 = _F(2.443315711809948e-5), _F(-1.388731625493765e-3), _F(4.166664568298827e-2)

_0, _1, _2, _3, _4, _HALF, _QUARTER = (_F(v) for v in (0.0, 1.0, 2.0, 3.0, 4.0, 0.5, 0.25))
_TWO_PI = _F(2.0 * np.pi)
_TO_UNIT = _F(2.0**-31)

TOGETHER = 256
"""Particles whose words and normals lie in the cache at a time."""


@scalar
def log(x):  # type: ignore[no-untyped-def]
    """log x for a float32 x ≥ 2⁻¹²⁶: x = 2^k (1 + f), √½ ≤ 1 + f < √2."""
    bits = _F(x).view(np.int32)
    exponent = (bits - _ROOT_HALF) >> _MANTISSA
    f = np.int32(bits - (exponent << _MANTISSA)).view(_F) - _1
    p = ((((_P0 * f + _P1) * f + _P2) * f + _P3) * f + _P4) * f + _P5
    p = ((p * f + _P6) * f + _P7) * f + _P8
    k, square = _F(exponent), f * f
    return k * _LN2_HIGH + (f + (p * f * square - _HALF * square + _LN2_LOW * k))


@scalar
def sincos_of_turns(t):  # type: ignore[no-untyped-def]
    """sin 2πt and cos 2πt for a float32 t in [0, 1]: t = q/4 + r, |r| ≤ ⅛."""
    q = np.floor(_4 * t + _HALF)
    r = (t - _QUARTER * q) * _TWO_PI
    z = r * r
    s = ((_S1 * z + _S2) * z + _S3) * z * r + r
    c = ((_C1 * z + _C2) * z + _C3) * z * z - _HALF * z + _1
    odd = (q == _1) | (q == _3)
    sin, cos = (c if odd else s), (s if odd else c)
    sin = -sin if (q == _2) | (q == _3) else sin
    cos = -cos if (q == _1) | (q == _2) else cos
    return sin, cos


@scalar
def normal_pair(word0, word1):  # type: ignore[no-untyped-def]
    """Two independent standard normals, float32, from two words uint32 [Box, Muller: A note on the
    generation of random normal deviates, 1958]. Of each word 31 bits are used: at most 6.7.
    """
    uniform = (_F(np.int32(word0 >> np.uint32(1))) + _HALF) * _TO_UNIT
    turn = _F(np.int32(word1 >> np.uint32(1))) * _TO_UNIT
    radius = np.sqrt(-_2 * log(uniform))
    sin, cos = sincos_of_turns(turn)
    return radius * cos, radius * sin


@kernel
def four_normals(words, normals, n, first, stream, step, part, key):  # type: ignore[no-untyped-def]
    """normals (4, ≥ n) float32: of the particles first … first + n − 1. words (4, ≥ n) uint32: room
    for theirs.
    """
    start = n - n  # a plain 0 would be a type of its own, and compiled for once more
    fill_words(words, first, stream, step, part, key, start, n)
    for pair in range(2):
        word0, word1 = words[2 * pair], words[2 * pair + 1]
        normal0, normal1 = normals[2 * pair], normals[2 * pair + 1]
        for i in range(n):
            normal0[i], normal1[i] = normal_pair(word0[i], word1[i])


def room() -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """For the words and normals of as many particles as are done at a time."""
    return np.empty((4, TOGETHER), np.uint32), np.empty((4, TOGETHER), np.float32)


def fill_normal(out, first, stream, step, part, key, start, stop):  # type: ignore[no-untyped-def]
    """out (4, N): standard normals of the particles first + start … first + stop − 1."""
    words, normals = room()
    for begin in range(start, stop, TOGETHER):
        n = min(TOGETHER, stop - begin)
        four_normals(words, normals, n, first + begin, stream, step, part, key)
        out[:, begin : begin + n] = normals[:, :n]
