"""Ancestors in proportion to the weights, whatever the chunk."""

import numpy as np
import pytest
from scipy.stats import chisquare

from mcloc.draws import Draws
from mcloc.errors import ConfigError
from mcloc.particles import Particles
from mcloc.resampling import (
    ALWAYS,
    Multinomial,
    Residual,
    Selective,
    Stratified,
    Systematic,
    when_ess_below,
)

OPEN = [name for name in ALWAYS if name != "residual"]  # to n that is found while drawing
WAYS = [(name, n) for name in ALWAYS for n in (13, None) if n or name in OPEN]


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


@pytest.mark.parametrize("n", [1, 10, 50, 3000])
def test_one_tooth_in_each_stratum_is_within_two_of_proportional(n):
    """A weight's stretch holds some strata whole, and a part of one at either end."""
    for seed in range(20):
        particles = weighted(seed=seed)
        ancestors = Stratified()(particles, n, Draws(seed, 1)).of(0, n)
        assert (np.abs(counts(particles, ancestors) - n * particles.weights) < 2.0).all()


@pytest.mark.parametrize("n", [1, 10, 50, 3000])
def test_residual_resampling_gives_each_its_whole_share(n):
    for seed in range(20):
        particles = weighted(seed=seed)
        ancestors = Residual()(particles, n, Draws(seed, 1)).of(0, n)
        assert len(ancestors) == n
        assert (counts(particles, ancestors) >= np.floor(n * particles.weights)).all()


@pytest.mark.parametrize("size", [3, 10, 49, 1000])
def test_residual_resampling_of_equal_weights_keeps_each_once(size):
    """1/N times N is 1, whatever the rounding."""
    ancestors = Residual()(Particles.equal(np.zeros((1, size))), size, Draws(1)).of(0, size)
    assert ancestors.tolist() == list(range(size))


def test_residual_resampling_must_know_how_many():
    with pytest.raises(ConfigError, match="--size fixed"):
        Residual()(weighted(), None, Draws(1))
    assert Residual().needs_n
    assert when_ess_below(0.5, Residual()).needs_n
    assert Selective(method="residual").needs_n
    assert not Selective(method="stratified").needs_n
    assert not any(ALWAYS[name]().needs_n for name in OPEN)


@pytest.mark.parametrize(("name", "n"), [(name, n and 5000) for name, n in WAYS])
def test_a_weight_of_zero_has_no_descendants(name, n):
    particles = weighted()
    ancestors = ALWAYS[name]()(particles, n, Draws(2, 1)).of(0, 5000)
    assert (particles.weights[ancestors] > 0.0).all()


@pytest.mark.parametrize(("name", "n"), [(name, n and 500) for name, n in WAYS])
@pytest.mark.parametrize("heavy", [0, 3, 9])
def test_one_particle_with_all_the_weight_is_the_ancestor_of_all(name, n, heavy):
    log_weights = np.full(10, -np.inf)
    log_weights[heavy] = 0.0
    particles = Particles.normalized(np.zeros((1, 10)), log_weights)
    assert (ALWAYS[name]()(particles, n, Draws(3, 1)).of(0, 500) == heavy).all()


@pytest.mark.parametrize(("name", "n"), [(name, n and 1) for name, n in WAYS])
def test_one_particle_has_one_descendant(name, n):
    particles = Particles.equal(np.zeros((1, 1)))
    assert ALWAYS[name]()(particles, n, Draws(3, 1)).of(0, 1).tolist() == [0]


@pytest.mark.parametrize(("name", "n"), [(name, n and 2000) for name, n in WAYS])
def test_chunks_make_no_difference(name, n):
    of = ALWAYS[name]()(weighted(), n, Draws(1, 1)).of
    parts = [of(a, b - a) for a, b in ((0, 3), (3, 1500), (1500, 2000))]
    assert np.array_equal(of(0, 2000), np.concatenate(parts))


@pytest.mark.parametrize("k", [0, 1, 5, 10])
def test_blocks_of_an_open_stratified_set_are_stratified_sets(k):
    """Of 2^k equal weights, 2^k teeth from a multiple of 2^k on meet each once."""
    particles = Particles.equal(np.zeros((1, 2**k)))
    for seed in range(5):
        of = Stratified()(particles, None, Draws(seed, 1)).of
        for block in (0, 1, 2, 3, 8, 21):
            assert sorted(of(block * 2**k, 2**k)) == list(range(2**k))


def test_every_prefix_of_an_open_stratified_set_is_nearly_proportional():
    """A set of n teeth is as many stratified sets as n has binary ones, each within two."""
    particles = weighted(12, spread=1.0)
    n = 20_000
    ancestors = Stratified()(particles, None, Draws(9, 1)).of(0, n)
    bound = 2.0 * np.array([i.bit_count() for i in range(1, n + 1)])
    for k, w in enumerate(particles.weights):
        assert (np.abs(np.cumsum(ancestors == k) - np.arange(1.0, n + 1.0) * w) < bound).all()


def test_teeth_of_an_open_stratified_set_are_uniform_and_independent_within_strata():
    """Over 4000 seeds: where teeth 5, 6 and 7 lie in their eighths. χ² over 4³ cells."""
    particles = Particles.equal(np.zeros((1, 32)))  # 4 particles an eighth
    places = np.array(
        [Stratified()(particles, None, Draws(s, 1)).of(5, 3) % 4 for s in range(4000)]
    )
    cells = np.bincount(places @ [16, 4, 1], minlength=64)
    assert chisquare(cells).pvalue > 1e-4


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


def repeated(name, particles, n, drawn, repeats=4000):
    """(repeats, N): counts of `drawn` descendants, one row a seed."""
    resampler = ALWAYS[name]()
    return np.array(
        [
            counts(particles, resampler(particles, n, Draws(seed, 1)).of(0, drawn))
            for seed in range(repeats)
        ]
    )


@pytest.mark.parametrize(("name", "n"), WAYS)
def test_counts_are_unbiased(name, n):
    """Mean counts of 13 descendants over 4000 seeds, within 4.5 of their own standard errors.

    Counts that never vary over the seeds are off by less than 1 in 4000.
    """
    particles = weighted(8, spread=1.0)
    found = repeated(name, particles, n, 13)
    error = np.abs(found.mean(axis=0) - 13 * particles.weights)
    assert (error < 4.5 * found.std(axis=0) / np.sqrt(4000) + 1 / 4000).all()
    assert found.std(axis=0).max() > 0.1


def exact_variances(w, f, n):
    """Of Σ f over n descendants: independent ones; one in each stratum; what residuals leave."""

    f = f.astype(float)

    def spread(p):
        return p @ f**2 - (p @ f) ** 2

    edges = np.linspace(0.0, 1.0, n + 1)
    ends = np.concatenate([[0.0], np.cumsum(w)])
    low = np.maximum.outer(ends[:-1], edges[:-1])
    high = np.minimum.outer(ends[1:], edges[1:])
    shares = n * np.maximum(high - low, 0.0)  # (N, n): of each stratum
    rest = n * w - np.floor(n * w)
    return {
        "multinomial": n * spread(w),
        "stratified": sum(spread(p) for p in shares.T),
        "residual": rest.sum() * spread(rest / rest.sum()),
    }


FUNCTIONS = {"square": np.arange(8.0) ** 2, "one": np.arange(8) == 3, "cos": np.cos(np.arange(8))}


@pytest.mark.parametrize("f", FUNCTIONS.values(), ids=FUNCTIONS)
@pytest.mark.parametrize("name", ["multinomial", "stratified", "residual"])
def test_variances_are_those_of_the_theory(name, f):
    """Of Σ f over 13 descendants, 4000 seeds, within 4.5 standard errors √((μ₄ − σ⁴) / 4000).

    Independent ancestors vary most [Douc, Cappé, Moulines: Comparison of resampling schemes for
    particle filtering, 2005].
    """
    particles = weighted(8, spread=1.0)
    values = repeated(name, particles, 13, 13) @ f
    exact = exact_variances(particles.weights, f, 13)
    fourth = np.mean((values - values.mean()) ** 4)
    error = np.sqrt((fourth - values.var() ** 2) / len(values))
    assert values.var() == pytest.approx(exact[name], abs=4.5 * error)
    assert exact[name] <= exact["multinomial"]


@pytest.mark.parametrize("name", OPEN)
def test_each_open_ancestor_alone_follows_the_weights(name):
    """The 5th ancestor over 4000 seeds: χ² over 7 particles that weigh something."""
    particles = weighted(8, spread=1.0)
    fifth = [ALWAYS[name]()(particles, None, Draws(s, 1)).of(5, 1)[0] for s in range(4000)]
    some = particles.weights > 0.0
    observed = np.bincount(fifth, minlength=8)[some]
    assert chisquare(observed, 4000 * particles.weights[some]).pvalue > 1e-4


def test_multinomial_ancestors_are_independent():
    """Neighbours over 20,000 draws: χ² of the table of pairs against the product."""
    particles = weighted(5, spread=0.5)
    ancestors = Multinomial()(particles, None, Draws(4, 1)).of(0, 20_000)
    pairs = np.bincount(5 * ancestors[::2] + ancestors[1::2], minlength=25)
    expected = 10_000 * np.outer(particles.weights, particles.weights).ravel()
    assert chisquare(pairs[expected > 0.0], expected[expected > 0.0]).pvalue > 1e-4


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


@pytest.mark.parametrize("name", ALWAYS)
def test_selective_resamples_by_the_method_that_is_named(name):
    particles = weighted(40, spread=3.0)
    by_name = Selective(method=name)(particles, 40, Draws(1, 1)).of(0, 40)
    assert np.array_equal(by_name, ALWAYS[name]()(particles, 40, Draws(1, 1)).of(0, 40))


def test_selective_by_an_unknown_method():
    with pytest.raises(ConfigError, match="one of systematic, stratified, residual, multinomial"):
        Selective(method="selective")


@pytest.mark.parametrize("size", [3, 5, 49, 500])
def test_systematic_resamples_equal_weights_too(size):
    """The size that is asked for would otherwise not be reached."""
    ancestry = Systematic()(Particles.equal(np.zeros((1, size))), 10, Draws(1, 1))
    assert ancestry.n == 10
    assert ancestry.log_weights is None
