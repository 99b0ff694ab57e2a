"""Ancestors in proportion to the weights, whatever the chunk."""

import numpy as np
import pytest
from scipy.stats import chisquare

from mcloc.draws import Draws
from mcloc.particles import Particles
from mcloc.resampling import Systematic, when_ess_below


def weighted(n=50, seed=0, spread=2.0):
    rng = np.random.default_rng(seed)
    log_weights = spread * rng.standard_normal(n)
    log_weights[::7] = -np.inf
    return Particles.normalized(np.arange(float(n))[None], log_weights)


def counts(particles, ancestors):
    return np.bincount(ancestors, minlength=len(particles))


@pytest.mark.parametrize("n", [1, 10, 50, 3000])
def test_a_comb_of_n_teeth_is_within_one_of_proportional(n):
    for seed in range(20):
        particles = weighted(seed=seed)
        ancestry = Systematic()(particles, n, Draws(seed, 1))
        assert ancestry.n == n
        assert ancestry.log_weights is None
        assert (np.abs(counts(particles, ancestry.of(0, n)) - n * particles.weights) < 1.0).all()


@pytest.mark.parametrize("n", [None, 5000])
def test_a_weight_of_zero_has_no_descendants(n):
    particles = weighted()
    ancestors = Systematic()(particles, n, Draws(2, 1)).of(0, 5000)
    assert (particles.weights[ancestors] > 0.0).all()


@pytest.mark.parametrize("n", [None, 2000])
def test_chunks_make_no_difference(n):
    of = Systematic()(weighted(), n, Draws(1, 1)).of
    parts = [of(a, b - a) for a, b in ((0, 3), (3, 1500), (1500, 2000))]
    assert np.array_equal(of(0, 2000), np.concatenate(parts))


def test_every_prefix_of_the_golden_sequence_is_nearly_proportional():
    """n D_n ≤ 3 + (1/log φ + 1/log 2) log n [Kuipers, Niederreiter, ch. 2, Theorem 3.4].

    D_n bounds the error of every interval, hence of every particle's count. Independent draws would
    miss by √(n w) ~ 100 at the end; a comb cut short by n (1 − w).
    """
    particles = weighted(12, spread=1.0)
    n = 100_000
    ancestors = Systematic()(particles, None, Draws(9, 1)).of(0, n)
    number = np.arange(1.0, n + 1.0)
    bound = 3.0 + (1.0 / np.log((1.0 + np.sqrt(5.0)) / 2.0) + 1.0 / np.log(2.0)) * np.log(number)
    for k, w in enumerate(particles.weights):
        assert (np.abs(np.cumsum(ancestors == k) - number * w) <= bound).all()


@pytest.mark.parametrize("n", [None, 13])
def test_counts_are_unbiased_over_offsets(n):
    """Mean counts of 13 descendants over 4000 seeds, within 4.5 of their own standard errors.

    Counts that never vary over the seeds are off by less than 1 in 4000.
    """
    particles = weighted(8, spread=1.0)
    found = np.array(
        [
            counts(particles, Systematic()(particles, n, Draws(seed, 1)).of(0, 13))
            for seed in range(4000)
        ]
    )
    error = np.abs(found.mean(axis=0) - 13 * particles.weights)
    assert (error < 4.5 * found.std(axis=0) / np.sqrt(4000) + 1 / 4000).all()
    assert found.std(axis=0).max() > 0.1


def test_each_adaptive_ancestor_alone_follows_the_weights():
    """The 5th ancestor over 4000 seeds: χ² over 7 particles that weigh something."""
    particles = weighted(8, spread=1.0)
    fifth = [Systematic()(particles, None, Draws(s, 1)).of(5, 1)[0] for s in range(4000)]
    some = particles.weights > 0.0
    observed = np.bincount(fifth, minlength=8)[some]
    assert chisquare(observed, 4000 * particles.weights[some]).pvalue > 1e-4


@pytest.mark.parametrize("n", [None, 30])
def test_a_set_of_enough_effective_particles_is_kept(n):
    particles = weighted(40, spread=0.3)
    ancestry = when_ess_below(0.5, Systematic())(particles, n, Draws(1, 1))
    assert particles.ess > 20
    assert ancestry.n == 40
    assert ancestry.of(7, 5).tolist() == [7, 8, 9, 10, 11]
    assert ancestry.log_weights is particles.log_weights


def test_a_set_of_too_few_effective_particles_is_resampled():
    particles = weighted(40, spread=3.0)
    ancestry = when_ess_below(0.5, Systematic())(particles, 40, Draws(1, 1))
    assert particles.ess < 20
    assert ancestry.log_weights is None
    assert np.array_equal(ancestry.of(0, 40), Systematic()(particles, 40, Draws(1, 1)).of(0, 40))


@pytest.mark.parametrize("size", [3, 5, 49, 500])
def test_systematic_resamples_equal_weights_too(size):
    """The size that is asked for would otherwise not be reached."""
    ancestry = Systematic()(Particles.equal(np.zeros((1, size))), 10, Draws(1, 1))
    assert ancestry.n == 10
    assert ancestry.log_weights is None
