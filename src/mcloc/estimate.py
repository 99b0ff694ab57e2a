"""From a sample set to an answer: hypotheses, most likely first, each with mean, covariance and
share.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.geometry import wrap
from mcloc.kernels.clusters import find_neighbours, join_hills, smooth
from mcloc.particles import Particles
from mcloc.statespace import StateSpace

BIN_LENGTH = 0.25  # m; with the smoothing, modes nearer than about 0.5 m are one
BIN_ANGLE = np.deg2rad(15.0)
VALLEY = (
    0.5  # two hills are two hypotheses if the density between them falls below half of the lower
)
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
    wall, is never taken.
    """
    labels = cluster(particles, space)
    count = int(labels.max()) + 1
    shares = np.bincount(labels, particles.weights, count)
    ranked = np.argsort(-shares, kind="stable")
    chosen = [k for k in ranked if shares[k] >= LEAST_SHARE] or [ranked[0]]
    return tuple(_moments(particles, space, labels == k, float(shares[k])) for k in chosen)


def cluster(particles: Particles, space: StateSpace) -> NDArray[np.intp]:
    """(N,): which cluster each particle belongs to, from 0."""
    circular = np.array(space.circular)
    around = round(2.0 * np.pi / BIN_ANGLE)
    sides = np.where(circular, 2.0 * np.pi / around, BIN_LENGTH)
    at = np.floor(particles.states / sides[:, None]).astype(np.int64)
    at[circular] %= around
    at[~circular] -= at[~circular].min(axis=1, keepdims=True) - 1
    extent = at.max(axis=1) + 2
    strides = np.concatenate([[1], np.cumprod(extent[:-1])])
    keys, which = np.unique(strides @ at, return_inverse=True)
    bins = np.stack([keys // s % e for s, e in zip(strides, extent, strict=True)])
    mass = np.bincount(which, particles.weights)

    offsets = np.array(list(itertools.product((-1, 0, 1), repeat=space.dimension)))
    neighbours = np.empty((len(keys), len(offsets)), dtype=np.int64)
    find_neighbours(keys, bins, offsets, np.where(circular, around, 0), strides, neighbours)
    density = np.empty(len(keys))
    smooth(mass, neighbours, 0.5 ** np.abs(offsets).sum(axis=1), density)
    root = np.empty(len(keys), dtype=np.int64)
    join_hills(np.argsort(-density, kind="stable"), density, neighbours, VALLEY, root)
    return np.unique(root, return_inverse=True)[1][which]


def _moments(
    particles: Particles, space: StateSpace, chosen: NDArray[np.bool_], share: float
) -> Hypothesis:
    """Mean and covariance of some of the particles, circular where the space is."""
    x, w = particles.states[:, chosen], particles.weights[chosen] / share
    circular = np.array(space.circular)
    mean = (x * w).sum(axis=1)
    mean[circular] = np.arctan2(
        (np.sin(x[circular]) * w).sum(axis=1), (np.cos(x[circular]) * w).sum(axis=1)
    )
    error = x - mean[:, None]
    error[circular] = wrap(error[circular])
    covariance = (error[:, None] * error[None, :] * w).sum(
        axis=2
    )  # not BLAS: its sums depend on threads
    return Hypothesis(mean, covariance, min(share, 1.0))
