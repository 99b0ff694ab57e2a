"""Weight, first and second moments of the particles in each bin, from which those of any union of
bins follow.
"""

import numpy as np
from numpy.typing import NDArray

from mcloc.kernels.elementary import sincos, wrapped
from mcloc.kernels.jit import kernel, share

_TOGETHER = 256  # particles whose terms are computed at once, 8 at a time
_ROW = _TOGETHER + 8  # rows at a power of two would all fall on the same lines of the cache
_PARTS = 8


@kernel
def add_moments(states, weights, labels, reference, circular, d, terms, sums, first, stop):  # type: ignore[no-untyped-def]
    """sums (K · M,): those of the particles first … stop − 1, added. M is a multiple of 4. d
    (D, _ROW), terms (M, _ROW): room; terms is 0.

    labels (N,): which bin each is in. reference (D, K): a state in each bin; d = x − reference, the
    short way around where circular (D,), is small, so that nothing is lost to rounding.
    """
    dimension = len(states)
    width = np.uint64(len(terms))
    pairs = dimension * (dimension + 1) // 2
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    for begin in range(first, stop, _TOGETHER):
        end = begin + _TOGETHER if begin + _TOGETHER < stop else stop
        w, label = weights[begin:end], labels[begin:end]
        mass = terms[0]
        for i in range(len(w)):
            mass[i] = w[i]
        row, angle = 1 + dimension, 1 + dimension + pairs
        for a in range(dimension):
            x, known, off, moment = states[a, begin:end], reference[a], d[a], terms[1 + a]
            for i in range(len(x)):
                off[i] = x[i] - known[label[i]]
            if circular[a]:
                sin, cos = terms[angle], terms[angle + 1]
                angle += 2
                for i in range(len(x)):
                    off[i] = wrapped(off[i])
                for i in range(len(x)):
                    s, c = sincos(x[i])
                    sin[i], cos[i] = w[i] * s, w[i] * c
            for i in range(len(x)):
                moment[i] = w[i] * off[i]
            for b in range(a + 1):
                second, other = terms[row], d[b]
                for i in range(len(x)):
                    second[i] = moment[i] * other[i]
                row += 1
        for i in range(len(w)):
            at = np.uint64(label[i]) * width
            for m in range(0, len(terms), 4):  # four at a time: 2.5 ns less
                n = np.uint64(m)
                sums[at + n] += terms[n, i]
                sums[at + n + one] += terms[n + one, i]
                sums[at + n + two] += terms[n + two, i]
                sums[at + n + three] += terms[n + three, i]


def moments_of_bins(
    states: NDArray[np.float64],
    weights: NDArray[np.float64],
    labels: NDArray[np.int32],
    reference: NDArray[np.float64],
    circular: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """(K, M): sums over the particles of each bin.

    Σ w; Σ w d_a for each axis a; Σ w d_a d_b for b ≤ a; Σ w sin x_a and Σ w cos x_a for each
    circular axis; 0 up to a multiple of 4. They are taken over up to 8 parts of the set, as many as
    its size bears, and added up in order: the same bits on any number of threads.
    """
    (dimension, bins), n = reference.shape, len(weights)
    width = 1 + dimension + dimension * (dimension + 1) // 2 + 2 * int(circular.sum())
    width = -(-width // 4) * 4
    parts = min(_PARTS, 1 + n // (64 * bins))
    sums = np.zeros((parts, bins * width))

    def run(start: int, stop: int) -> None:
        room = np.empty((dimension, _ROW)), np.zeros((width, _ROW))
        for p in range(start, stop):
            first, last = n * p // parts, n * (p + 1) // parts
            add_moments(states, weights, labels, reference, circular, *room, sums[p], first, last)

    share(run, parts, 8.0 * n)
    total: NDArray[np.float64] = sums.sum(axis=0).reshape(bins, width)
    return total
