"""log Σ_i exp(a_i + scale · b_i), weights and the sum of their squares.

Sums are those of blocks of 4096 particles, added up in order: the same bits on any number of
threads. Scale 0 leaves b out.
"""

import numpy as np
from numpy.typing import NDArray

from mcloc.kernels.elementary import exp
from mcloc.kernels.jit import kernel, scalar, share

_BLOCK = 4096
_LONG_BLOCK = 1 << 15  # of what NumPy does
_WORK = 1.5  # ns a particle


@kernel
def summed(a, b, scales, terms, tops, sums, start, stop):  # type: ignore[no-untyped-def]
    """tops (S, blocks): for each scale the largest of each block, NaN where there is one; sums:
    Σ exp(… − top). terms (_BLOCK,): room.
    """
    for block in range(start, stop):
        first = block * _BLOCK
        x, y = a[first : first + _BLOCK], b[first : first + _BLOCK]
        for k in range(len(scales)):
            scale, top, bottom, unsound = scales[k], -np.inf, np.inf, 0
            for i in range(len(x)):
                value = x[i] if scale == 0.0 else x[i] + scale * y[i]
                terms[i] = value
                unsound += value != value
                top = value if value > top else top
                bottom = value if value < bottom else bottom
            tops[k, block] = np.nan if unsound else top
            if top == bottom and np.isfinite(top):  # as on free floor before a scan has come
                sums[k, block] = len(x)
                continue
            shift = top if np.isfinite(top) else 0.0
            for i in range(len(x)):
                terms[i] = exp(terms[i] - shift)
            sums[k, block] = _total(terms, len(x))


@scalar
def _total(terms, n):  # type: ignore[no-untyped-def]
    """Σ terms[:n], in four sums: an addition need not wait for the last one."""
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    whole = n // 4
    for j in range(whole):
        s0 += terms[4 * j]
        s1 += terms[4 * j + 1]
        s2 += terms[4 * j + 2]
        s3 += terms[4 * j + 3]
    for j in range(4 * whole, n):
        s0 += terms[j]
    return (s0 + s1) + (s2 + s3)


def log_sums(
    a: NDArray[np.float64], b: NDArray[np.float64], *scales: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """For each scale (S,) the largest a + scale b, NaN if there is one; and log Σ exp of all, −inf
    where there is no weight at all.
    """
    blocks, several = -(-len(a) // _BLOCK), np.array(scales)
    tops, sums = np.empty((len(scales), blocks)), np.empty((len(scales), blocks))
    work = _WORK * len(a) * len(scales)
    share(lambda i, j: summed(a, b, several, np.empty(_BLOCK), tops, sums, i, j), blocks, work)
    top = tops.max(axis=1)
    shift = np.maximum(top, -1e300)
    with np.errstate(divide="ignore", invalid="ignore"):
        total = shift + np.log((sums * np.exp(tops - shift[:, None])).sum(axis=1))
    return top, total


def weights(a: NDArray[np.float64]) -> tuple[NDArray[np.float64], float, float]:
    """exp(a) (N,), its sum, and the sum of its squares. a ≤ 0."""
    out, part = np.empty(len(a)), np.empty((2, -(-len(a) // _LONG_BLOCK)))

    def run(start: int, stop: int) -> None:
        for block in range(start, stop):
            some = slice(block * _LONG_BLOCK, (block + 1) * _LONG_BLOCK)
            w = np.exp(a[some], out=out[some])
            part[:, block] = w.sum(), np.square(w).sum()

    share(run, part.shape[1], _WORK * len(a))
    total, squares = part.sum(axis=1).tolist()
    return out, total, squares
