"""Noise with mean 0 and covariance C on a grid of poses, as taps: by how many cells which part of
the mass moves.

What x and y do for a given θ is parted from the rest: with s = C_xy,θ / C_θθ,

    C = C_θθ (s, 1)ᵀ (s, 1) + S,  S = Σ_i λ_i e_i e_iᵀ,  λ_i ≥ 0,  e_i whole numbers of cells.

First mass turns by j slices, nearly normal with variance C_θθ, and is moved by j s on the way; then
λ_i / 2 moves by each of ± e_i within its slice. Mean and covariance are those of the motion model.
"""

import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcloc.filters.selling import Reals, selling

LEAST_RATIO = 1.0 / 256.0
"""Of the less to the larger eigenvalue of S: noise that is narrower, 1 : 16 in deviations, would
need taps to cells far away."""

MOST_SENT = 0.5
"""Of a cell's mass in a round. Sending more leaves a hole: noise of a cell each time would fill
every other cell only."""

ROUNDS = 3  # of each stride: what is blurred by then fills the holes of one twice as long


@dataclass(frozen=True, eq=False)
class Taps:
    """Where the mass in each slice comes from, in one round.

    slices, rows, columns: (K, T) of the source's heading, and by how many cells it lies before the
    target. weights: (K, T) float32, those of 0 last; what leaves a cell and what stays sum to 1.
    """

    slices: NDArray[np.intp]
    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    weights: NDArray[np.float32]


class Move(NamedTuple):
    """What some of the mass does: by how many cells along x and y (K, 2), by how many slices, and
    which part (K,) of the mass of each slice it is.
    """

    straight: Reals
    slices: int
    weight: Reals


def taps(noise: Reals, offsets: Reals) -> list[Taps]:
    """The rounds, one after the other; none for noise that is 0.

    noise: (K, 3, 3) covariance of x, y, θ in each slice, in cells and slices; the variance of θ is
    the same in all. offsets: (K, 2) by how much the cells of each slice lie beside those of the
    others, in cells along x and y.

    Mass that comes to another slice comes in between its cells. It goes to the four around, in
    proportion: the mean is kept, the variance grows by d (1 − d) for a share d of a cell along each
    axis, at most ¼ cell² of what changes the slice. S is made less by that, as far as it goes; what
    remains is the price of slices that merge.
    """
    heading, excess, found = float(noise[0, 2, 2]), np.zeros_like(offsets), []
    slope = noise[:, :2, 2] / (heading or 1.0)
    if heading > 0.0:
        moves = [Move(j * slope, j, np.full(len(slope), part)) for j, part in _turns(heading)]
        for move in moves:
            _, d = _between(move, offsets)
            excess += move.weight[:, None] * d * (1.0 - d)
        found.append(_gathered(moves, offsets))
    given = noise[:, :2, :2] - heading * slope[:, :, None] * slope[:, None, :]
    weights, e = selling(_less(given, excess))
    for stride, sent in _rounds(float(weights.sum(axis=1).max())):
        stays = Move(np.zeros_like(offsets), 0, 1.0 - sent * weights.sum(axis=1))
        moves = [
            Move(way * e[:, i].astype(np.float64), 0, 0.5 * sent * weights[:, i])
            for way in (stride, -stride)
            for i in range(3)
        ]
        found.append(_gathered([stays, *moves], offsets))
    return found


def _turns(variance: float) -> list[tuple[int, float]]:
    """By how many slices mass turns, and which part of it."""
    line = np.ones(1)
    for stride, sent in _rounds(variance):
        part = np.zeros(2 * stride + 1)
        part[[0, -1]], part[stride] = 0.5 * sent * variance, 1.0 - sent * variance
        line = np.convolve(line, part)
    return [(k - len(line) // 2, float(part)) for k, part in enumerate(line)]


def _rounds(total: float) -> list[tuple[int, float]]:
    """The stride of each round, and what part of the weights it has. total: their sum, at most,
    with strides of 1.
    """
    rounds: list[tuple[int, float]] = []
    stride, left = 1, total
    while left > 1e-9 * total:
        most = MOST_SENT * stride**2
        n = min(math.ceil(left / most), ROUNDS)
        each = min(left / n, most)
        rounds += [(stride, each / (stride**2 * total))] * n
        stride, left = 2 * stride, left - n * each
    return rounds


def _less(given: Reals, excess: Reals) -> Reals:
    """(K, 2, 2): S without the excess (K, 2), with eigenvalues from LEAST_RATIO of the larger on;
    nothing where more was to be taken than there is.
    """
    less = given.copy()
    less[:, (0, 1), (0, 1)] -= excess
    values, vectors = np.linalg.eigh(less)
    values = np.maximum(values, LEAST_RATIO * np.maximum(values[:, -1:], 0.0))
    bounded: Reals = np.einsum("nab,nb,ncb->nac", vectors, values, vectors)
    return bounded


def _between(move: Move, offsets: Reals) -> tuple[NDArray[np.intp], Reals]:
    """(K, 2): how many whole cells, and which part of one, the mass of each slice moves relative to
    the cells of the slice that it comes to.
    """
    beside = move.straight + offsets - np.roll(offsets, -move.slices, axis=0)
    whole = np.floor(beside + 1e-9)
    return whole.astype(np.intp), np.maximum(beside - whole, 0.0)


def _gathered(moves: list[Move], offsets: Reals) -> Taps:
    """All mass, sorted by the slice that it comes to."""
    own, found = np.arange(len(offsets)), []
    for move in moves:
        whole, part = _between(move, offsets)
        for corner in itertools.product((0, 1), repeat=2):
            share = np.where(corner, part, 1.0 - part).prod(axis=1)
            to = (own + move.slices) % len(own)
            found.append((own, to, whole + corner, move.weight * share))
    table = (np.concatenate(column) for column in zip(*found, strict=True))
    slices, targets, moved, weight = table
    kept = np.flatnonzero(weight > 1e-12)  # float32 could not tell less
    kept = kept[np.argsort(targets[kept], kind="stable")]
    slices, targets, moved, weight = slices[kept], targets[kept], moved[kept], weight[kept]
    nth = np.arange(len(kept)) - np.searchsorted(targets, targets)
    shape = len(own), int(nth.max()) + 1
    sources, rows, columns = np.zeros((3, *shape), np.intp)
    sources[targets, nth], columns[targets, nth], rows[targets, nth] = slices, *moved.T
    weights = np.zeros(shape, np.float32)
    weights[targets, nth] = weight
    return Taps(sources, rows, columns, weights)
