"""Dual MCL on a corridor of tiles against Bayes' rule by enumeration.

The ends stop the robot, so π(x_t | u_t) is not constant, and for some x_t it is 0; one tile is
hardly ever stood on. Density trees are made so that each leaf is one tile: they are exact here. How
far real ones are off: test_dual_kalman.py.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from mcloc.density_tree import DensityTree
from mcloc.draws import Draws, Stream
from mcloc.errors import FilterError
from mcloc.filters.particle_filter import Part, ParticleBelief, ParticleFilter
from mcloc.particles import Particles
from mcloc.proposals.dual import Dual
from mcloc.proposals.forward import Forward
from mcloc.proposals.predictive import BackwardTree, ForwardTree, Pairs
from mcloc.resampling import Systematic
from mcloc.sample_size import Fixed
from mcloc.statespace import LINE

TILES = 11
DARK = np.array([1, 0, 0, 1, 0, 1, 1, 0, 0, 0, 1], dtype=bool)
PRIOR = np.where(np.arange(TILES) == 4, 0.2, 1.0)  # p(x | m)
UNIFORM = np.full(TILES, 1.0 / TILES)
MOVES = (1, 2, 1, -3)
SEEN = (True, False, True, False)


def likelihood(z):
    return np.where(z == DARK, 0.9, 0.1)


def drawn(chances, row, u):
    """(1, n): the tile that each uniform meets in its row of chances (R, TILES)."""
    teeth = np.arange(len(chances))[:, None] + np.cumsum(chances, axis=1)
    found = np.searchsorted(teeth.ravel(), row + u) - TILES * row
    return found.clip(0, TILES - 1).astype(float)[None]


@dataclass(frozen=True)
class Steps:
    """A move by u tiles, and a slip, of so many tiles with such a chance; the ends of the corridor
    stop the robot.
    """

    slips: tuple[tuple[int, float], ...]
    wild: tuple[tuple[int, float], ...]

    @cache  # noqa: B019 - of a few moves
    def transition(self, u):
        """(TILES, TILES): p(x_t | u, x_{t−1}), x_{t−1} by row."""
        p = np.zeros((TILES, TILES))
        for tile in range(TILES):
            for slip, chance in self.slips:
                p[tile, min(max(tile + u + slip, 0), TILES - 1)] += chance
        return p

    def sample(self, x, u, draws, first):
        chance = draws.uniform(Stream.MOTION, first, x.shape[1])[0]
        return drawn(self.transition(u), x[0].astype(int), chance)

    def log_density(self, x_new, u, x):
        with np.errstate(divide="ignore"):
            return np.log(self.transition(u)[x[0].astype(int), x_new[0].astype(int)])

    def sample_previous(self, x_new, u, draws, first):
        into = self.transition(u).T
        back = into / np.maximum(into.sum(axis=1, keepdims=True), 1e-300)
        chance = draws.uniform(Stream.MOTION, first, x_new.shape[1])[0]
        return drawn(back, x_new[0].astype(int), chance)

    def log_pi(self, x_new, u):
        with np.errstate(divide="ignore"):
            return np.log(self.transition(u).sum(axis=0)[x_new[0].astype(int)])

    def doubted(self):
        return Steps(self.wild, self.wild)


STEPS = Steps(((-1, 0.1), (0, 0.7), (1, 0.2)), ((-4, 0.3), (-1, 0.4), (0, 0.3)))


class Colour:
    """p(dark | tile), 0.9 for the right colour."""

    def log_likelihood(self, x, z):
        return np.log(likelihood(z))[x[0].astype(int)]

    def source(self, z):
        return "tile"

    def readings(self, z):
        return 1.0


class Corridor:
    """Every tile as likely; the robot hardly ever stands on one of them."""

    def sample(self, draws, first, n):
        return np.floor(TILES * draws.uniform(Stream.RANDOM_POSE, first, n)[:1])

    def log_density(self, x):
        return np.full(x.shape[1], -np.log(TILES))

    def log_prior(self, x):
        return np.log(PRIOR)[x[0].astype(int)]


class Found:
    """Tiles by given chances, drawn from a given stream."""

    log_pi = 0.0

    def __init__(self, chances, stream):
        self.chances, self.stream = chances, stream

    def sample(self, draws, first, n):
        return drawn(self.chances[None], 0, draws.uniform(self.stream, first, n)[0])

    def log_density(self, x):
        return np.log(self.chances)[x[0].astype(int)]


@dataclass(frozen=True)
class Sampler:
    """q̄ = p(z | x)^power / its sum."""

    stream: Stream
    power: float = 1.0

    def given(self, z, draws):
        chances = likelihood(z) ** self.power
        return Found(chances / chances.sum(), self.stream)


@dataclass(frozen=True)
class Only:
    """q̄ on a single tile, whatever is measured."""

    tile: int

    def given(self, z, draws):
        chances = np.where(np.arange(TILES) == self.tile, 1.0, 1e-300)
        return Found(chances, Stream.TREE)


@dataclass(frozen=True)
class Given:
    """A recovery that always says the same."""

    share: float = 0.0
    doubted: float = 0.0
    rates = 0.1, 0.02

    def alpha(self, evidence):
        return self.share

    def doubt(self, evidence, likelihood):
        return self.doubted


def tree_of_tiles(particles):
    """A root from −0.5 to 15.5 is halved into tiles: particles of weight 0 hold it there, and two
    of each of the others see to it that no wider box is a leaf.
    """
    n = 2 * len(particles) + 2
    fences = 7.5 + 8.0 * (n - 1) / (n + 1) * np.array([[-1.0, 1.0]])
    half = particles.log_weights - np.log(2.0)
    fenced = Particles(
        np.concatenate([particles.states, particles.states, fences], axis=1),
        np.concatenate([half, half, [-np.inf, -np.inf]]),
    )
    return DensityTree.fit(fenced, LINE, floor=0.0, leaf=1, least_side=0.9)


# The stream is one that the way draws from as well, with the worst to be feared from a number that
# two of them share.
DUALS = {
    "pairs": Dual(Sampler(Stream.ANCESTOR), Pairs()),
    "forward tree": Dual(Sampler(Stream.MOTION), ForwardTree(fit=tree_of_tiles)),
    "backward tree": Dual(Sampler(Stream.MOTION), BackwardTree(tree_of_tiles)),
    "backward tree, near": Dual(Sampler(Stream.CHOICE, 0.5), BackwardTree(tree_of_tiles)),
}
DYNAMICS = {
    "plain": Given(),
    "random particles": Given(share=0.3),
    "doubt": Given(doubted=0.4),
    "both": Given(share=0.3, doubted=0.4),
}
every_dual = pytest.mark.parametrize("dual", DUALS.values(), ids=DUALS)


def exact(dynamics, moves=MOVES, seen=SEEN, bel=UNIFORM):
    """Bel and p(z_1 … z_t) by enumeration."""
    evidence, alpha, doubt = 1.0, dynamics.share, dynamics.doubted
    for u, z in zip(moves, seen, strict=True):
        moved = (1.0 - doubt) * STEPS.transition(u) + doubt * STEPS.doubted().transition(u)
        joint = ((1.0 - alpha) * bel @ moved + alpha * UNIFORM) * PRIOR * likelihood(z)
        evidence *= joint.sum()
        bel = joint / joint.sum()
    return bel, evidence


def tile_filter(parts, dynamics):
    return ParticleFilter(STEPS, Colour(), Corridor(), tuple(parts), dynamics, LINE)


def histogram(particles):
    return np.bincount(particles.states[0].astype(int), particles.weights, TILES)


def runs(parts, dynamics, repeats):
    """(repeats, TILES): the last beliefs; (repeats,): what the evidence is estimated to be."""
    tiles = tile_filter(parts, dynamics)
    beliefs, evidence = np.empty((repeats, TILES)), np.zeros(repeats)
    for seed in range(repeats):
        bel = tiles.start(Corridor(), Draws(seed))
        for step, (u, z) in enumerate(zip(MOVES, SEEN, strict=True), 1):
            bel, info = tiles.step(bel, u, z, Draws(seed, step))
            evidence[seed] += info.log_evidence
        beliefs[seed] = histogram(bel.particles)
    return beliefs, np.exp(evidence)


def test_the_trees_here_are_exact():
    rng = np.random.default_rng(1)
    particles = Particles.normalized(rng.integers(0, TILES, (1, 40)) * 1.0, rng.normal(size=40))
    found = np.exp(tree_of_tiles(particles).log_density(np.arange(TILES)[None] * 1.0))
    assert found == pytest.approx(histogram(particles), abs=1e-12)


def test_some_tiles_cannot_be_reached_and_others_from_everywhere():
    """What makes π matter: on tile 0 after a move of 2 it is 0, on the last one more than 3."""
    pi = np.exp(STEPS.log_pi(np.arange(TILES)[None] * 1.0, 2))
    assert pi[0] == 0.0
    assert pi[-1] > 3.0


@pytest.mark.parametrize("name", ["plain", "both"])
@every_dual
def test_errors_fall_as_root_n(falls_as_root_n, dual, name):
    sizes, results, dynamics = (128, 1024, 8192), [], DYNAMICS[name]
    expected, _ = exact(dynamics)
    for n in sizes:
        beliefs, _ = runs([Part(1.0, dual, Fixed(n))], dynamics, 100)
        results.append(np.sum((beliefs - expected) ** 2, axis=1))
    falls_as_root_n(sizes, results)


@pytest.mark.parametrize("dynamics", DYNAMICS.values(), ids=DYNAMICS)
@every_dual
def test_the_mean_weights_estimate_the_evidence(dual, dynamics):
    """Without bias where densities are exact, so mean of 300 within 4.5 deviations."""
    _, found = runs([Part(1.0, dual, Fixed(100))], dynamics, 300)
    _, expected = exact(dynamics)
    assert np.std(found) < expected
    assert np.mean(found) == pytest.approx(expected, abs=4.5 * np.std(found) / np.sqrt(300))


@pytest.mark.parametrize("groups", [(0, 0), (0, 1)], ids=["one group", "two groups"])
@every_dual
def test_beside_forward_particles_the_belief_is_the_same(falls_as_root_n, dual, groups):
    """Both parts cover the target, so it makes no difference in what they compete."""
    sizes, results, dynamics = (128, 1024, 8192), [], DYNAMICS["both"]
    expected, _ = exact(dynamics)
    for n in sizes:
        parts = [
            Part(0.7, Forward(Systematic()), Fixed(n // 2), groups[0]),
            Part(0.3, dual, Fixed(n // 2), groups[1]),
        ]
        beliefs, _ = runs(parts, dynamics, 100)
        results.append(np.sum((beliefs - expected) ** 2, axis=1))
    falls_as_root_n(sizes, results)


WAYS = {name: DUALS[name].way for name in ("pairs", "forward tree", "backward tree")}


@pytest.mark.parametrize("groups", [(0, 0), (0, 1)], ids=["one group", "two groups"])
@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_poses_that_nobody_believed_in_leave_it_to_the_others(way, groups):
    """No pair fits and no tree reaches there: every weight of the part is 0, and none is NaN."""
    impossible = Dual(Only(10), way)
    before = ParticleBelief(Particles.equal(np.full((1, 500), 2.0)))
    forward = Part(0.8, Forward(Systematic()), Fixed(300), groups[0])
    found = []
    for parts in ([forward], [forward, Part(0.2, impossible, Fixed(200), groups[1])]):
        after, _ = tile_filter(parts, Given()).step(before, 1, True, Draws(5, 1))
        found.append(histogram(after.particles))
    assert found[1] == pytest.approx(found[0], abs=1e-12)
    assert found[1][10] == 0.0
    alone = tile_filter([Part(1.0, impossible, Fixed(200))], Given())
    with pytest.raises(FilterError, match="weight"):
        alone.step(before, 1, True, Draws(5, 1))


def test_a_sampler_that_misses_the_place_keeps_its_share_in_a_group_of_its_own_only():
    """The robot is between tiles 2 and 4; the sampler knows no other tile than 10, which α U alone
    makes possible: 0.9 · 0.1/11 of the predictive density, against 0.1 · 0.9 and more elsewhere.

    In its own group the part keeps φ = 0.2 there, whatever its evidence. In one group it has what
    its evidence is worth, φ e_dual / (φ e_dual + (1 − φ) e), next to its share of the forward part.
    """
    dynamics, phi = Given(share=0.1), 0.2
    start = np.arange(TILES) == 2.0
    bel, evidence = exact(dynamics, (1,), (True,), start)
    missed = bel[10] * evidence
    found = {}
    for groups in ((0, 0), (0, 1)):
        parts = [
            Part(1.0 - phi, Forward(Systematic()), Fixed(40_000), groups[0]),
            Part(phi, Dual(Only(10), Pairs()), Fixed(1000), groups[1]),
        ]
        tiles = tile_filter(parts, dynamics)
        before = ParticleBelief(Particles.equal(np.full((1, 500), 2.0)))
        after, _ = tiles.step(before, 1, True, Draws(5, 1))
        found[groups] = histogram(after.particles)[10]
    together = (phi * missed + (1.0 - phi) * missed) / (phi * missed + (1.0 - phi) * evidence)
    apart = phi + (1.0 - phi) * bel[10]
    deviation = np.sqrt(0.1 / TILES / 40_000) * 0.9 / evidence  # of the forward particles on it
    assert found[(0, 0)] == pytest.approx(together, abs=4.5 * deviation)
    assert found[(0, 1)] == pytest.approx(apart, abs=4.5 * deviation)
    assert together < 0.05 < 0.2 < apart
