"""A step of the particle filter, its hypotheses, and a density tree, as a competent user of NumPy
writes them, see `reference`. Python loops run over bins and levels, never over particles.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from mcloc.benchmarks.reference import (
    Array,
    Table,
    Whole,
    kld_size,
    log_sum_exp,
    moved,
    sum_over_points,
    systematic,
    wrap,
)

Poses = list[tuple[Array, Array, float]]
"""Mean, covariance and share of each hypothesis."""

Update = tuple[Poses, float, float]
"""The hypotheses, the effective sample size, and the likelihood of one reading."""


@dataclass(frozen=True)
class Model:
    """What a step needs to know: log p(z | x) and log p(x | m) by cell, and the rest.

    points (B, 2): endpoints of the scan in the robot's frame. beta: power of the likelihood.
    readings: what the scan is worth. drive: as for `moved`.
    """

    field: Table
    prior: Table
    points: Array
    beta: float
    readings: float
    drive: tuple[float, ...]


def step_fixed(x: Array, weights: Array, model: Model, rng: np.random.Generator) -> Update:
    """After resampling, moving and weighing as many particles as there are."""
    ancestors = systematic(weights, rng.random(), len(weights))
    return _updated(*_drawn(x, ancestors, model, rng), model.readings)


def step_adaptive(
    x: Array,
    weights: Array,
    model: Model,
    rng: np.random.Generator,
    sides: Array,
    bounds: tuple[float, float],
    limits: tuple[int, int],
) -> Update:
    """The same with as many as KLD-sampling asks for, found while drawing in growing chunks."""
    cumulative, chunks, n, offset = np.cumsum(weights), [], 0, rng.random()
    while True:
        count = max(2048, n // 4)
        teeth = np.mod(offset + (n + np.arange(count)) * 0.5 * (np.sqrt(5.0) - 1.0), 1.0)
        ancestors = np.searchsorted(cumulative, teeth * cumulative[-1], side="right")
        chunks.append(_drawn(x, ancestors, model, rng))
        n += count
        states = np.concatenate([chunk[0] for chunk in chunks], axis=1)
        enough = kld_size(states, sides, *bounds, limits)
        if enough < n or n >= limits[1]:
            break
    before, likelihood = (np.concatenate([c[k] for c in chunks])[:enough] for k in (1, 2))
    return _updated(states[:, :enough], before, likelihood, model.readings)


def _drawn(
    x: Array, ancestors: Whole, model: Model, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """States (3, n), log p(x | m) and β log p(z | x) (n,) of the children of some particles."""
    states = moved(x[:, ancestors], model.drive, rng)
    before = sum_over_points(states, np.zeros((1, 2)), model.prior)
    return states, before, model.beta * sum_over_points(states, model.points, model.field)


def _updated(states: Array, before: Array, likelihood: Array, readings: float) -> Update:
    """What a filter finds out of what was drawn."""
    log_weights = before + likelihood
    weights = np.exp(log_weights - log_sum_exp(log_weights))
    of_one = np.exp(log_sum_exp(before + likelihood / readings) - log_sum_exp(before))
    return hypotheses(states, weights), float(1.0 / np.sum(weights**2)), float(of_one)


def hypotheses(
    x: Array,
    weights: Array,
    length: float = 0.25,
    around: int = 24,
    valley: float = 0.5,
    least: float = 0.01,
) -> Poses:
    """Hills of the smoothed histogram with bins of length m and 2π / around rad, those that share
    less than `least` left out.
    """
    sides = np.array([length, length, 2.0 * np.pi / around])
    at = np.floor(x / sides[:, None]).astype(np.int64)
    at[2] %= around
    at[:2] -= at[:2].min(axis=1, keepdims=True) - 1
    extent = at.max(axis=1) + 2
    strides = np.array([1, extent[0], extent[0] * extent[1]])
    keys, which = np.unique(strides @ at, return_inverse=True)
    mass = np.bincount(which, weights)
    bins = np.stack([keys // s % e for s, e in zip(strides, extent, strict=True)])

    offsets = np.array(list(itertools.product((-1, 0, 1), repeat=3)))
    beside = bins[:, :, None] + offsets.T[:, None]
    beside[2] %= around
    wanted = np.tensordot(strides, beside, 1)
    found = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    neighbours = np.where(keys[found] == wanted, found, -1)
    near = np.where(neighbours >= 0, mass[neighbours], 0.0)
    density = near @ 0.5 ** np.abs(offsets).sum(axis=1)
    label = _hills(density, neighbours, valley)[which]

    shares = np.bincount(label, weights)
    chosen = [k for k in np.argsort(-shares, kind="stable") if shares[k] >= least]
    return [_moments(x, weights, label == k) for k in chosen or [int(shares.argmax())]]


def _hills(density: Array, neighbours: Whole, valley: float) -> Whole:
    """(K,): the hill of each bin. A hill that rises by less than 1/valley over a saddle joins."""
    root = [-1] * len(density)

    def top(k: int) -> int:
        while root[k] != k:
            k = root[k]
        return k

    for k in np.argsort(-density, kind="stable").tolist():
        tops = {top(j) for j in neighbours[k].tolist() if j >= 0 and root[j] >= 0}
        highest = max(tops, key=lambda t: (density[t], -t), default=k)
        root[k] = highest
        for t in tops - {highest}:
            if density[k] >= valley * density[t]:
                root[t] = highest
    _, hill = np.unique([top(k) for k in range(len(root))], return_inverse=True)
    return hill


def _moments(x: Array, weights: Array, chosen: Array) -> tuple[Array, Array, float]:
    """Mean, covariance and share of some of the particles."""
    x, share = x[:, chosen], float(weights[chosen].sum())
    w = weights[chosen] / share
    mean = x @ w
    mean[2] = np.arctan2(np.sin(x[2]) @ w, np.cos(x[2]) @ w)
    error = x - mean[:, None]
    error[2] = wrap(error[2])
    return mean, (error * w) @ error.T, share


def density_tree(x: Array, weights: Array, places: Array, leaf: int) -> Array:
    """(M,): log density at places (3, M) of a kd-tree over x (3, N), whose boxes are halved in
    turn along x, y and θ until they hold at most `leaf` samples. All boxes of a level at once: a
    box is the number of its place among those of the level.
    """
    low = np.append(x[:2].min(axis=1), -np.pi)
    side = np.append(np.ptp(x[:2], axis=1) + 1e-9, 2.0 * np.pi) * (1.0 + 1e-9)
    within, wanted = ((v - low[:, None]) / side[:, None] for v in (x, places))
    inside = ((wanted >= 0.0) & (wanted < 1.0)).all(axis=0)
    box, at = np.zeros(x.shape[1], dtype=np.int64), np.zeros(places.shape[1], dtype=np.int64)
    open_, volume = np.ones(x.shape[1], dtype=bool), float(side.prod())
    density = np.zeros(places.shape[1])
    todo = np.flatnonzero(inside)
    for level in range(60):
        keys, which, counts = np.unique(box[open_], return_inverse=True, return_counts=True)
        mass = np.bincount(which, weights[open_])
        found = np.minimum(np.searchsorted(keys, at[todo]), len(keys) - 1)
        known = keys[found] == at[todo]
        done = ~known | (counts[found] <= leaf)
        density[todo[done]] = np.where(known, mass[found], 0.0)[done] / volume
        todo = todo[~done]
        open_[np.flatnonzero(open_)[counts[which] <= leaf]] = False
        if not len(todo) or not open_.any():
            break
        axis, halves = level % 3, 2 ** (level // 3 + 1)
        box[open_] = 2 * box[open_] + (within[axis, open_] * halves).astype(np.int64) % 2
        at[todo] = 2 * at[todo] + (wanted[axis, todo] * halves).astype(np.int64) % 2
        volume /= 2.0
    with np.errstate(divide="ignore"):
        return np.log(density)
