"""Draws: distributions, independence, and invariance to chunks.

Seeds are fixed; for a random one a Kolmogorov–Smirnov test would fail with probability 1e-4, and so
would each test of ten million draws, all of its comparisons together.
"""

import itertools

import numpy as np
import pytest
from scipy.stats import kstest, norm

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


USES = [  # seed, step, part and stream; each by itself another than in the first
    (Draws(2026, 5, 0), Stream.MOTION),
    (Draws(2027, 5, 0), Stream.MOTION),
    (Draws(2026, 6, 0), Stream.MOTION),
    (Draws(2026, 1_000_005, 0), Stream.MOTION),
    (Draws(2026, 5, 1), Stream.MOTION),
    (Draws(2026, 5, 2), Stream.MOTION),
    *((Draws(2026, 5, 0), stream) for stream in Stream if stream != Stream.MOTION),
]
PARTICLES = 250_000
LAGS = 0, 1, 2, 3, 4, 8, 16, 255, 256, 257, 4096


@pytest.fixture(scope="module", params=["uniform", "normal"])
def many(request):
    """A distribution, and ten million draws of it, or more: (4 · uses, 250,000), a row for each use
    and draw.
    """
    rows = [getattr(draws, request.param)(stream, 0, PARTICLES) for draws, stream in USES]
    assert np.size(rows) >= 10_000_000
    return request.param, np.concatenate(rows)


def largest_by_chance(comparisons):
    """What that many standard normals together exceed with P / 2, either way. The other half is for
    sums of so many terms, which are nearly normal.
    """
    return norm.isf(P / 4.0 / comparisons)


def standardized(name, rows, power):
    """Powers of the draws less their mean, by their mean and deviation; those of u − ½."""
    if name == "uniform":
        mean = np.array([1.0, 0.0, 1 / 12, 0.0, 1 / 80, 0.0, 1 / 448, 0.0, 1 / 2304])
        rows = rows - 0.5
    else:
        mean = np.array([1.0, 0.0, 1.0, 0.0, 3.0, 0.0, 15.0, 0.0, 105.0])
    centred = rows**power - mean[power]
    return centred / np.sqrt(mean[2 * power] - mean[power] ** 2)


def test_ten_million_draws_are_distributed_as_they_should(many):
    name, rows = many
    assert kstest(rows.ravel(), {"uniform": "uniform", "normal": "norm"}[name]).pvalue > P


def test_ten_million_draws_have_the_moments_that_they_should(many):
    """The first four, of all together and of each of the four draws of a particle."""
    name, rows = many
    for power in (1, 2, 3, 4):
        errors = standardized(name, rows, power)
        sums = errors.reshape(len(USES), 4, PARTICLES).sum(axis=(0, 2))
        found = np.append(sums / np.sqrt(rows.size / 4), sums.sum() / np.sqrt(rows.size))
        assert np.abs(found).max() < largest_by_chance(4 * 5)


def correlations(a, b):
    """(rows, rows): Σ a_i b_j / √n. By products so small that they stay on one thread: several of
    them took up to a minute instead of a second while the machine had other things to do.
    """
    n = a.shape[1] // 128 * 128
    a, b = (v[:, :n].reshape(len(v), -1, 128).transpose(1, 0, 2) for v in (a, b))
    return (a @ b.transpose(0, 2, 1)).sum(axis=0) / np.sqrt(n)


@pytest.mark.parametrize("power", [1, 2], ids=["draws", "squares"])
def test_ten_million_draws_are_independent(many, power):
    """Of particles near to each other and far, from seed to seed, step to step, part to part and
    use to use, and the four of one particle: correlations of all rows with all at all lags.
    """
    name, rows = many
    values = standardized(name, rows, power)
    pairs = len(LAGS) * len(rows) ** 2
    for lag in LAGS:
        correlation = correlations(values[:, lag:], values[:, : PARTICLES - lag])
        if lag == 0:
            np.fill_diagonal(correlation, 0.0)
        assert np.abs(correlation).max() < largest_by_chance(pairs)


def test_of_part_changes_the_part_alone():
    assert Draws(5, 2).of_part(3) == Draws(5, 2, 3)


@pytest.mark.parametrize("seed", [-1, 2**64])
def test_a_seed_out_of_range_is_refused(seed):
    with pytest.raises(ConfigError, match="seed must be a whole number from 0 to 2"):
        Draws(seed)
