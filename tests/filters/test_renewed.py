"""A share of random particles: as many as it says, which skip moving, and a belief that is that of
Bayes' rule with dynamics (1 − α) p_d + α U.
"""

import itertools
from functools import cache

import numpy as np
import pytest

from mcloc.draws import Draws
from mcloc.environment import Tiles
from mcloc.filters.particle_filter import Part, ParticleFilter
from mcloc.filters.recovery import NoRandomParticles
from mcloc.motion.tiles import TileMotion
from mcloc.particles import Particles
from mcloc.proposals.forward import Forward
from mcloc.proposals.renewed import Renewed
from mcloc.proposals.target import Target
from mcloc.resampling import Multinomial, Systematic, when_ess_below
from mcloc.sample_size import KLD, Fixed
from mcloc.sensors.grey_tile import GreyTile
from mcloc.statespace import LINE


class Marked:
    """States −1, −2, …, so that random particles are known from others, and that none is drawn
    but they.
    """

    def sample(self, draws, first, n):
        return -1.0 - np.arange(first, first + n, dtype=float)[None]

    def log_prior(self, x):
        return np.where(x[0] < 0.0, -0.5, 0.0)


class Onwards:
    """A move of 100."""

    def sample(self, x, u, draws, first):
        return x + 100.0


class Near:
    """log p(z | x) = −|x|: it tells all states apart."""

    def log_likelihood(self, x, z):
        return -1e-3 * np.abs(x[0])


def source_of(n, share, draws):
    old = Particles.equal(np.arange(5.0)[None])
    target = Target(old, None, None, 0.0, 0.0, Onwards(), Near(), Marked())
    source, count = Renewed(Forward(Systematic()), share).prepare(target, n, draws)
    assert count == n
    return source


def random_ones(n, share, seed):
    """(n,): which particles are random."""
    drawn = source_of(n, share, Draws(seed, 3))(0, n)
    random = drawn.states[0] < 0.0
    assert np.array_equal(drawn.states[0, random], -1.0 - np.arange(random.sum()))
    assert ((drawn.states[0, ~random] >= 100.0) & (drawn.states[0, ~random] < 105.0)).all()
    assert np.array_equal(drawn.log_before, np.where(random, -0.5, 0.0))
    assert np.array_equal(drawn.log_likelihoods, Near().log_likelihood(drawn.states, None))
    return random


@pytest.mark.parametrize("n", [1, 6, 10, 36, 97, 5000])
@pytest.mark.parametrize("share", [0.0, 0.03, 0.1, 1 / 3, 0.5, 0.99])
def test_as_many_are_random_as_the_share_says(n, share):
    """share · n rounded up or down, which of them by chance: its mean is right. Random ones do not
    move, and are weighed like the others.
    """
    counts = np.array([random_ones(n, share, seed).sum() for seed in range(200)])
    exact = share * n
    assert np.isin(counts, [np.floor(exact + 1e-9), np.ceil(exact - 1e-9)]).all()
    up = exact - np.floor(exact + 1e-9)
    deviation = np.sqrt(max(up * (1.0 - up), 0.0) / len(counts))
    assert counts.mean() == pytest.approx(exact, abs=4.5 * deviation + 1e-9)


def test_each_particle_is_random_as_often():
    """In strata: one of every ten, and not always the same one."""
    random = np.array([random_ones(50, 0.1, seed) for seed in range(1000)])
    deviation = np.sqrt(0.1 * 0.9 / 1000)
    assert random.mean(axis=0) == pytest.approx(np.full(50, 0.1), abs=4.5 * deviation)
    assert all(set(np.diff(np.flatnonzero(row))) <= {9, 10, 11} for row in random)


@pytest.mark.parametrize("n", [40, None])
def test_whatever_the_chunk_they_are_the_same(n):
    source = source_of(n, 0.13, Draws(7, 2))
    whole = source(0, 40)
    for cuts in ((0, 40), (0, 1, 2, 25, 40), (0, 20, 40), tuple(range(41))):
        parts = [source(a, b - a) for a, b in itertools.pairwise(cuts)]
        for k in range(3):
            assert np.array_equal(np.concatenate([p[k] for p in parts], axis=-1), whole[k])


TILES, SHARE = 11, 0.2
MOVES, SEEN = (1, 1, -1, 0), (3, 6, 2, 4)
MOTION, SENSOR = TileMotion((TILES,)), GreyTile((TILES,))


class Corridor(Tiles):
    """Of the tiles the robot hardly ever stands on one."""

    def log_prior(self, x):
        return super().log_prior(x) + np.where(x[0] == 4.0, np.log(0.2), 0.0)


@cache
def exact():
    """Bel by enumeration; dynamics p(x | m) [(1 − α) p_d + α U]."""
    tiles = np.arange(TILES)
    prior = np.where(tiles == 4, 0.2, 1.0)
    r = 1.0 / (1.0 + np.abs(tiles[:, None] - tiles))
    seen = r / r.sum(axis=0)
    bel = np.full(TILES, 1.0 / TILES)
    for u, z in zip(MOVES, SEEN, strict=True):
        p = np.zeros((TILES, TILES))
        for x in tiles:
            possible = [t for t in (x - 1, x, x + 1) if 0 <= t < TILES]
            meant = x + u if x + u in possible else x
            for t in possible:
                p[x, t] = 0.5 if t == meant else 0.5 / (len(possible) - 1)
        joint = ((1.0 - SHARE) * bel @ p + SHARE / TILES) * prior * seen[z]
        bel = joint / joint.sum()
    return bel


def beliefs(resampler, size, repeats):
    """(repeats, TILES)."""
    part = Part(1.0, Renewed(Forward(resampler), SHARE), size)
    environment, recovery = Corridor((TILES,)), NoRandomParticles(doubt_below=0.0)
    tiles = ParticleFilter(MOTION, SENSOR, environment, (part,), recovery, LINE)
    found = np.empty((repeats, TILES))
    for seed in range(repeats):
        bel = tiles.start(environment, Draws(seed))
        for step, (u, z) in enumerate(zip(MOVES, SEEN, strict=True), 1):
            bel, _ = tiles.step(bel, np.array([u]), np.array([z]), Draws(seed, step))
        x = bel.particles.states[0].astype(int)
        found[seed] = np.bincount(x, bel.particles.weights, TILES)
    return found


RESAMPLERS = {
    "systematic": Systematic(),
    "multinomial": Multinomial(),
    "selective": when_ess_below(0.6, Systematic()),
}


@pytest.mark.parametrize("resampler", RESAMPLERS.values(), ids=RESAMPLERS)
def test_errors_fall_as_root_n(falls_as_root_n, resampler):
    sizes = (64, 512, 4096)
    results = [np.sum((beliefs(resampler, Fixed(n), 150) - exact()) ** 2, axis=1) for n in sizes]
    falls_as_root_n(sizes, results)


def test_errors_fall_as_root_n_where_the_size_is_found_while_drawing(falls_as_root_n):
    sizes = (64, 512, 4096)
    results = []
    for n in sizes:
        size = KLD(bin_length=1.0, minimum=n, maximum=n)
        results.append(np.sum((beliefs(Systematic(), size, 150) - exact()) ** 2, axis=1))
    falls_as_root_n(sizes, results)
