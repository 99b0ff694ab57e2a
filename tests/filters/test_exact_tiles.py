"""The particle filter on a corridor of tiles against Bayes' rule by enumeration.

The robot stands on one of 11 tiles, tries to move, may slip, is stopped by the ends, and sees
whether its tile is dark. What the filter knows of this is a MotionModel, a SensorModel and a
uniform Environment on LINE.
"""

from dataclasses import replace

import numpy as np
import pytest

from mcloc.draws import Draws, Stream
from mcloc.errors import FilterError
from mcloc.filters.particle_filter import Part, ParticleBelief, ParticleFilter
from mcloc.filters.recovery import NoRandomParticles, RandomParticles
from mcloc.particles import Particles
from mcloc.proposals.forward import Forward
from mcloc.protocols import Weighed
from mcloc.resampling import Systematic, when_ess_below
from mcloc.sample_size import KLD, Fixed
from mcloc.statespace import LINE

TILES = 11
DARK = np.array([1, 0, 0, 1, 0, 1, 1, 0, 0, 0, 1], dtype=bool)
SLIPS = {-1: 0.1, 0: 0.7, 1: 0.2}  # tiles beside the one that was meant
MOVES = (1, 2, 1, -3)
SEEN = (True, False, True, False)
UNIFORM = np.full(TILES, 1.0 / TILES)


class Steps:
    """A move by u tiles, with slips; the ends of the corridor stop the robot."""

    def sample(self, x, u, draws, first):
        chance = draws.uniform(Stream.MOTION, first, x.shape[1])[0]
        slip = np.searchsorted(np.cumsum(list(SLIPS.values())), chance) - 1.0
        return np.clip(x + u + slip, 0.0, TILES - 1.0)

    def doubted(self):
        return self


class Colour:
    """p(dark | tile), 0.9 for the right colour; an eye that says None sees nothing."""

    def log_likelihood(self, x, z):
        return np.log(likelihood(z))[x[0].astype(int)]

    def source(self, z):
        return "tile"

    def readings(self, z):
        return 1.0


class Anywhere:
    """Every tile as likely."""

    def sample(self, draws, first, n):
        return np.floor(TILES * draws.uniform(Stream.RANDOM_POSE, first, n)[:1])

    def log_density(self, x):
        return np.full(x.shape[1], -np.log(TILES))

    def log_prior(self, x):
        return np.zeros(x.shape[1])


def likelihood(z):
    return np.where(z == DARK, 0.9, 0.1)


def exact(moves, seen, alpha):
    """Bel and p(z_1 … z_t) by enumeration: dynamics (1 − α) p_d + α U, then Bayes' rule."""
    bel, evidence = UNIFORM, 1.0
    for u, z in zip(moves, seen, strict=True):
        transition = np.zeros((TILES, TILES))
        for tile in range(TILES):
            for slip, p in SLIPS.items():
                transition[tile, np.clip(tile + u + slip, 0, TILES - 1)] += p
        joint = ((1.0 - alpha) * bel @ transition + alpha * UNIFORM) * likelihood(z)
        evidence *= joint.sum()
        bel = joint / joint.sum()
    return bel, evidence


def tile_filter(parts, recovery=None):
    return ParticleFilter(
        Steps(), Colour(), Anywhere(), tuple(parts), recovery or NoRandomParticles(), LINE
    )


def histogram(particles):
    return np.bincount(particles.states[0].astype(int), particles.weights, TILES)


def squared_errors(tiles, expected, repeats):
    """(repeats,): Σ over tiles of the squared error of Bel, and the particles used a step."""
    errors, used = np.empty(repeats), 0
    for seed in range(repeats):
        bel = tiles.start(Anywhere(), Draws(seed))
        for step, (u, z) in enumerate(zip(MOVES, SEEN, strict=True), 1):
            bel, info = tiles.step(bel, u, z, Draws(seed, step))
            used += info.n
        errors[seed] = np.sum((histogram(bel.particles) - expected) ** 2)
    return errors, used / repeats / len(MOVES)


def resampler(ess_below):
    return Systematic() if ess_below == 1.0 else when_ess_below(ess_below, Systematic())


def pinned(n):
    """The way of adaptive sizes, which draw until they have enough, with n particles."""
    return KLD(bin_length=1.0, minimum=n, maximum=n)


@pytest.mark.parametrize("ess_below", [1.0, 0.6], ids=["always", "when-ess-below"])
@pytest.mark.parametrize("alpha", [0.0, 0.3], ids=["plain", "random-particles"])
@pytest.mark.parametrize("size", [Fixed, pinned])
def test_errors_fall_as_root_n(falls_as_root_n, size, alpha, ess_below):
    sizes, results = (64, 512, 4096), []
    expected, _ = exact(MOVES, SEEN, alpha)
    recovery = RandomParticles(share=alpha)
    for n in sizes:
        part = Part(1.0, Forward(resampler(ess_below)), size(n))
        errors, used = squared_errors(tile_filter([part], recovery), expected, 150)
        assert used == n
        results.append(errors)
    falls_as_root_n(sizes, results)


def test_errors_fall_as_root_n_where_kld_finds_the_size(falls_as_root_n):
    sizes, results = [], []
    expected, _ = exact(MOVES, SEEN, 0.0)
    for epsilon in (0.2, 0.02, 0.003):
        rule = KLD(epsilon=epsilon, bin_length=1.0, minimum=10)
        tiles = tile_filter([Part(1.0, Forward(Systematic()), rule)])
        errors, used = squared_errors(tiles, expected, 150)
        sizes.append(used)
        results.append(errors)
    assert sizes[-1] > 30 * sizes[0]
    falls_as_root_n(sizes, results)


@pytest.mark.parametrize("ess_below", [1.0, 0.6], ids=["always", "when-ess-below"])
@pytest.mark.parametrize("alpha", [0.0, 0.3], ids=["plain", "random-particles"])
@pytest.mark.parametrize("size", [Fixed, pinned])
def test_the_mean_weights_estimate_the_evidence(size, alpha, ess_below):
    """Π exp(log_evidence) is unbiased for p(z_1 … z_4) [Del Moral]; mean of 300, 4.5 deviations."""
    part = Part(1.0, Forward(resampler(ess_below)), size(100))
    tiles, found = tile_filter([part], RandomParticles(share=alpha)), []
    for seed in range(300):
        bel, total = tiles.start(Anywhere(), Draws(seed)), 0.0
        for step, (u, z) in enumerate(zip(MOVES, SEEN, strict=True), 1):
            bel, info = tiles.step(bel, u, z, Draws(seed, step))
            total += info.log_evidence
        found.append(np.exp(total))
    expected = exact(MOVES, SEEN, alpha)[1]
    assert np.std(found) < expected
    assert np.mean(found) == pytest.approx(expected, abs=4.5 * np.std(found) / np.sqrt(300))


class Sceptic:
    """Looks at the predictive density, and at nothing else."""

    def __init__(self):
        self.looked_at = []

    def without_people(self, z, predictive):
        self.looked_at.append(predictive(400))
        return None, 1.0


def test_what_is_left_out_is_judged_by_the_predictive_density():
    """Σ_x' p(x | u, x') Bel(x'), by enumeration; without the measurement this is Bel as well.

    Mean over 200 runs of 400 particles from as many: deviations below ½/√80,000 twice over.
    """
    before, _ = exact(MOVES[:1], SEEN[:1], 0.0)
    moved = np.zeros(TILES)
    for tile in range(TILES):
        for slip, p in SLIPS.items():
            moved[np.clip(tile + MOVES[1] + slip, 0, TILES - 1)] += p * before[tile]
    part = Part(1.0, Forward(Systematic()), Fixed(400))
    plain, sceptic = tile_filter([part]), Sceptic()
    sceptical = replace(plain, people=sceptic)
    believed = np.zeros(TILES)
    for seed in range(200):
        bel = plain.start(Anywhere(), Draws(seed))
        bel, info = plain.step(bel, MOVES[0], SEEN[0], Draws(seed, 1))
        assert info.filtered == 0.0
        after, info = sceptical.step(bel, MOVES[1], SEEN[1], Draws(seed, 2))
        assert info.filtered == 1.0
        believed += histogram(after.particles) / 200
        assert not np.array_equal(sceptic.looked_at[-1].states, after.particles.states)
    looked_at = np.mean([histogram(particles) for particles in sceptic.looked_at], axis=0)
    for found in (looked_at, believed):
        assert found == pytest.approx(moved, abs=4.5 * 0.5 * np.sqrt(2.0 / 80_000) + 1 / 400)


# Parts and normalization groups, with proposals that draw one tile each.


class OneTile:
    """Draws one tile alone, with a given weight."""

    def __init__(self, tile, weight):
        self.tile, self.weight = tile, weight

    def prepare(self, target, n, draws):
        def source(first, count):
            with np.errstate(divide="ignore"):
                weights = np.full(count, np.log(self.weight))
            return Weighed(np.full((1, count), float(self.tile)), np.zeros(count), weights)

        return source, n


def one_step(parts):
    tiles = tile_filter(parts)
    bel = ParticleBelief(Particles.equal(np.zeros((1, 10))))
    return histogram(tiles.step(bel, 0, True, Draws(1, 1))[0].particles)


def test_parts_of_a_group_compete_by_evidence():
    found = one_step([Part(0.7, OneTile(2, 1.0), Fixed(30)), Part(0.3, OneTile(5, 4.0), Fixed(70))])
    assert found[[2, 5]] == pytest.approx([0.7 / 1.9, 1.2 / 1.9])


def test_separate_groups_keep_their_share():
    found = one_step(
        [Part(0.7, OneTile(2, 1.0), Fixed(30), 0), Part(0.3, OneTile(5, 4.0), Fixed(70), 1)]
    )
    assert found[[2, 5]] == pytest.approx([0.7, 0.3])


def test_groups_of_several_parts():
    """Group 0 holds 0.6: its parts share it as 0.2 · 1 to 0.4 · 3."""
    parts = [
        Part(0.2, OneTile(1, 1.0), Fixed(10), 0),
        Part(0.4, OneTile(2, 3.0), Fixed(25), 0),
        Part(0.4, OneTile(3, 9.0), Fixed(5), 1),
    ]
    assert one_step(parts)[[1, 2, 3]] == pytest.approx([0.6 / 7.0, 0.6 * 6.0 / 7.0, 0.4])


@pytest.mark.parametrize("groups", [(0, 0, 0), (0, 1, 2)])
def test_a_part_without_weight_drops_out(groups):
    """Its mass goes to the others, in proportion to theirs."""
    parts = [
        Part(phi, OneTile(tile, weight), Fixed(10), group)
        for phi, tile, weight, group in zip(
            (0.5, 0.3, 0.2), (1, 2, 3), (0.0, 2.0, 2.0), groups, strict=True
        )
    ]
    assert one_step(parts)[[1, 2, 3]] == pytest.approx([0.0, 0.6, 0.4])


@pytest.mark.parametrize("groups", [(0, 0), (0, 1)])
def test_two_parts_of_the_same_proposal_are_one(groups):
    """Both draw from the same q by numbers of their own: the belief is still that of Bayes.

    Mean over 200 runs of 2 × 200 particles; each tile's error has a deviation below ½/√400, their
    mean below ½/√80,000; 4.5 of them and a bias of order 1/400.
    """
    parts = [
        Part(phi, Forward(Systematic()), Fixed(200), g)
        for phi, g in zip((0.8, 0.2), groups, strict=True)
    ]
    tiles, total = tile_filter(parts), np.zeros(TILES)
    for seed in range(200):
        bel = tiles.start(Anywhere(), Draws(seed))
        for step in (1, 2):
            bel, info = tiles.step(bel, MOVES[step - 1], SEEN[step - 1], Draws(seed, step))
        assert info.n == 400
        total += histogram(bel.particles) / 200
    expected, _ = exact(MOVES[:2], SEEN[:2], 0.0)
    assert total == pytest.approx(expected, abs=4.5 * 0.5 / np.sqrt(80_000) + 1 / 400)


def test_no_weight_at_all():
    with pytest.raises(FilterError, match="weight"):
        one_step(
            [Part(0.5, OneTile(1, 0.0), Fixed(10), 0), Part(0.5, OneTile(2, 0.0), Fixed(10), 1)]
        )


@pytest.mark.parametrize("groups", [(0, 0), (0, 1)])
def test_a_weight_that_is_not_a_number(groups):
    parts = [
        Part(0.5, OneTile(1, w), Fixed(10), g) for w, g in zip((1.0, np.nan), groups, strict=True)
    ]
    with pytest.raises(FilterError, match="NaN"):
        one_step(parts)
