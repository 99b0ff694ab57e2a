"""From a sample set to an answer: hypotheses, most likely first, each with mean, covariance and
share.
"""

import itertools
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mcloc.kernels.bins import Bins
from mcloc.kernels.clusters import find_neighbours, join_hills, smooth
from mcloc.kernels.moments import moments_of_bins
from mcloc.particles import Particles
from mcloc.statespace import StateSpace

BIN_LENGTH = 0.25  # m; with the smoothing, modes nearer than about 0.5 m are one
BIN_ANGLE = float(np.deg2rad(15.0))  # a whole number of them makes a circle
VALLEY = (
    0.5  # two hills are two hypotheses if the density between them falls below half of the lower
)
ONE_PLACE = 1.0  # m around the mean
LEAST_SHARE = 0.01  # smaller ones are counted with no hypothesis, unless there is no other


@dataclass(frozen=True, eq=False, slots=True)
class Hypothesis:
    """One place where the robot may be.

    mean: (D,) circular in angles; for a robot x, y in m and θ in rad, map frame. covariance: (D, D)
    of the particles around it. share: its part of the belief, 0 … 1.
    """

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    share: float


def hypotheses(particles: Particles, space: StateSpace) -> tuple[Hypothesis, ...]:
    """The modes of a belief, largest share first; at least one.

    A mode is a hill of the belief's smoothed histogram. The mean of two modes, which may lie in a
    wall, is never taken. All is found from the bins of the histogram and the moments in each.
    """
    histogram = _Histogram(particles, space)
    hill_of, count = histogram.hills()
    shares = np.bincount(hill_of, histogram.mass, count)
    ranked = np.argsort(-shares, kind="stable")
    chosen = ranked[: max(int((shares >= LEAST_SHARE).sum()), 1)]
    rank = np.full(count, -1)
    rank[chosen] = np.arange(len(chosen))
    means, covariances = histogram.moments(rank[hill_of], len(chosen))
    return tuple(
        Hypothesis(mean, covariance, min(float(shares[k]), 1.0))
        for k, mean, covariance in zip(chosen, means, covariances, strict=True)
    )


def cluster(particles: Particles, space: StateSpace) -> NDArray[np.intp]:
    """(N,): which hill each particle belongs to, from 0."""
    histogram = _Histogram(particles, space)
    hill_of, _ = histogram.hills()
    of_bin = np.empty(len(hill_of), dtype=np.intp)
    of_bin[histogram.order] = hill_of
    return of_bin[histogram.labels]


def away(particles: Particles, space: StateSpace) -> float:
    """How much of a belief lies farther than ONE_PLACE from its mean, along the straight axes."""
    w, squares = particles.weights, np.zeros(len(particles))
    for x, circular in zip(particles.states, space.circular, strict=True):
        if not circular:
            # Not a matrix product: BLAS may add in another order with other threads.
            apart = x - np.einsum("n,n->", x, w)
            squares += np.square(apart, out=apart)
    return float(w[squares > ONE_PLACE**2].sum())


class _Histogram:
    """A belief by the bins that it occupies, in the order of their keys."""

    def __init__(self, particles: Particles, space: StateSpace) -> None:
        self.circular, self.around, sides = _axes(space)
        self.bins = Bins(sides, self.around)
        x = particles.states
        self.labels = self.bins.add(x)
        reference = np.ascontiguousarray(x[:, self.bins.first[: self.bins.known]])
        sums = moments_of_bins(x, particles.weights, self.labels, reference, self.circular)
        self.order, self.keys, self.coordinates = self.bins.sorted()
        self.reference, self.sums = reference[:, self.order], sums[self.order]

    @property
    def mass(self) -> NDArray[np.float64]:
        """(K,): of each bin."""
        return self.sums[:, 0]

    def hills(self) -> tuple[NDArray[np.intp], int]:
        """(K,): which hill each bin belongs to, from 0; and how many there are."""
        offsets, weights = _around(len(self.circular))
        neighbours = np.empty((len(self.keys), len(offsets)), dtype=np.int64)
        periods = self.around.astype(np.int64)
        find_neighbours(
            self.keys, self.coordinates, offsets, periods, self.bins.strides, neighbours
        )
        density = np.empty(len(self.keys))
        smooth(self.mass.copy(), neighbours, weights, density)
        root = np.empty(len(self.keys), dtype=np.int64)
        join_hills(np.argsort(-density, kind="stable"), density, neighbours, VALLEY, root)
        is_top = root == np.arange(len(root))
        number = np.cumsum(is_top) - 1
        return number[root], int(number[-1]) + 1

    def moments(
        self, group: NDArray[np.intp], groups: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Means (G, D) and covariances (G, D, D) of the particles in groups of bins, circular where
        the space is. group: (K,) of each bin, from 0; < 0 for none.

        With e = reference − mean, Σ w (d + e)(d + e)ᵀ is over the particles of a bin Σ w d dᵀ +
        e Σ w dᵀ + Σ w d eᵀ + e eᵀ Σ w.
        """
        d, circular = len(self.circular), self.circular
        bins = np.argsort(group, kind="stable")[np.count_nonzero(group < 0) :]
        group, sums, reference = group[bins], self.sums[bins], self.reference[:, bins].T
        starts = np.searchsorted(group, np.arange(groups))
        weight, first = sums[:, 0], sums[:, 1 : 1 + d]
        totals = np.add.reduceat(sums, starts)
        share, angle = totals[:, 0], 1 + d + d * (d + 1) // 2
        mean = np.add.reduceat(first + weight[:, None] * reference, starts) / share[:, None]
        sines = totals[:, angle : angle + 2 * int(circular.sum())]
        mean[:, circular] = np.arctan2(sines[:, ::2], sines[:, 1::2])
        e = reference - mean[group]
        e[:, circular] -= 2.0 * np.pi * np.rint(e[:, circular] / (2.0 * np.pi))
        crossed = e[:, :, None] * (first + 0.5 * weight[:, None] * e)[:, None, :]
        moments = sums[:, 1 + d + _pairs(d)] + crossed + crossed.transpose(0, 2, 1)
        return mean, np.add.reduceat(moments, starts) / share[:, None, None]


@cache
def _pairs(dimension: int) -> NDArray[np.intp]:
    """(D, D): where the moment of two axes stands among those of all pairs b ≤ a."""
    a, b = np.indices((dimension, dimension))
    high, low = np.maximum(a, b), np.minimum(a, b)
    pairs: NDArray[np.intp] = high * (high + 1) // 2 + low
    return pairs


@cache
def _axes(
    space: StateSpace,
) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.float64]]:
    """(D,): which axes are circular, how many bins go around each (0: straight), their sides."""
    circular = np.array(space.circular)
    around = np.where(circular, float(round(2.0 * np.pi / BIN_ANGLE)), 0.0)
    return circular, around, np.where(circular, BIN_ANGLE, BIN_LENGTH)


@cache
def _around(dimension: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """(M, D): the offsets of a bin's neighbours and its own; (M,) their weights in smoothing."""
    offsets = np.array(list(itertools.product((-1, 0, 1), repeat=dimension)))
    return offsets, 0.5 ** np.abs(offsets).sum(axis=1)
