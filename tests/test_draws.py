"""Draws: distributions, independence, and invariance to chunks.

Seeds are fixed; for a random one a Kolmogorov–Smirnov test would fail with probability 1e-4.
"""

import itertools

import numpy as np
import pytest
from scipy.stats import kstest

from mcloc.draws import Draws, Stream
from mcloc.errors import ConfigError

N = 40_000
P = 1e-4


def test_uniforms_are_uniform_and_never_0_or_1():
    u = Draws(3, 1).uniform(Stream.ANCESTOR, 0, N)
    assert u.shape == (4, N)
    assert u.min() > 0.0
    assert u.max() < 1.0
    for row in u:
        assert kstest(row, "uniform").pvalue > P


def test_normals_are_normal():
    n = Draws(3, 1).normal(Stream.MOTION, 0, N)
    assert n.shape == (4, N)
    for row in n:
        assert kstest(row, "norm").pvalue > P


def test_squares_of_normals_are_independent_too():
    """Box–Muller pairs share a radius: their squares correlate where the angle is wrong."""
    squares = Draws(4, 1).normal(Stream.MOTION, 0, N) ** 2
    correlation = np.corrcoef(squares) - np.eye(4)
    assert np.abs(correlation).max() < 4.5 / np.sqrt(N)  # 6 pairs, each with deviation N^-1/2


def test_chunks_make_no_difference():
    draws = Draws(12, 3, 1)
    for fill in (draws.uniform, draws.normal):
        whole = fill(Stream.RANDOM_POSE, 10, 500)
        parts = [fill(Stream.RANDOM_POSE, 10 + a, b - a) for a, b in ((0, 1), (1, 333), (333, 500))]
        assert np.array_equal(whole, np.concatenate(parts, axis=1))


def test_uses_share_no_number():
    """Seeds, steps, parts and streams, pairwise: uncorrelated and without a common value."""
    uses = [
        (Draws(seed, step, part), stream)
        for seed in (0, 1, 2**32, 2**64 - 1)
        for step in (0, 1)
        for part in (0, 1)
        for stream in Stream
    ]
    rows = np.array([draws.uniform(stream, 0, 2000)[0] for draws, stream in uses])
    correlation = np.corrcoef(rows) - np.eye(len(rows))
    # 2016 pairs of deviation 2000^-1/2: 5 deviations are passed by chance once in a thousand seeds.
    assert np.abs(correlation).max() < 5.0 / np.sqrt(2000)
    for a, b in itertools.combinations(rows, 2):
        assert not (a == b).any()


def test_neighbouring_particles_are_independent():
    u = Draws(5).uniform(Stream.MOTION, 0, N).T.ravel()
    for lag in (1, 2, 3, 4, 8):
        correlation = np.corrcoef(u[:-lag], u[lag:])[0, 1]
        assert abs(correlation) < 4.5 / np.sqrt(len(u))


def test_of_part_changes_the_part_alone():
    assert Draws(5, 2).of_part(3) == Draws(5, 2, 3)


@pytest.mark.parametrize("seed", [-1, 2**64])
def test_a_seed_out_of_range_is_refused(seed):
    with pytest.raises(ConfigError, match="seed must be a whole number from 0 to 2"):
        Draws(seed)
