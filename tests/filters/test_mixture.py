"""The mixture proposal on a line against Bayes' rule on a fine grid.

The robot is somewhere on 20 m; its moves and its measurements have Gaussian noise, a measurement
has two places that explain it, and with probability α it is carried off to anywhere.
"""

import numpy as np
import pytest

from mcloc.density_tree import DensityTree
from mcloc.draws import Draws, Stream
from mcloc.filters.particle_filter import Part, ParticleBelief, ParticleFilter
from mcloc.filters.recovery import RandomParticles
from mcloc.particles import Particles
from mcloc.proposals.forward import Forward
from mcloc.proposals.mixture import Mixture
from mcloc.proposals.predictive import ForwardTree
from mcloc.proposals.relocating import Relocating
from mcloc.resampling import Systematic, Tempered
from mcloc.sample_size import Fixed
from mcloc.statespace import LINE

HALF = 10.0  # m; the line is from −10 to 10
MOVED, MEASURED, APART = 0.3, 0.2, 7.0  # m
MOVES, SEEN = (0.0, 1.0, 0.5, 0.5), (1.0, 2.0, 2.6, -4.0)  # the last one is after a kidnapping
ALPHA = 0.1
WAY = ForwardTree(4000, lambda particles: DensityTree.fit(particles, LINE))
GRID = np.linspace(-HALF, HALF, 4001)


def bell(x, sigma):
    return np.exp(-0.5 * (x / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi))


def likelihood(x, z):
    """Of the place z, and half as much of its alias 7 m to the left."""
    return bell(x - z, MEASURED) + 0.5 * bell(x - z + APART, MEASURED) + 1e-6


class Drive:
    def sample(self, x, u, draws, first):
        return x + u + MOVED * draws.normal(Stream.MOTION, first, x.shape[1])[:1]

    def doubted(self):
        return self


class Place:
    def log_likelihood(self, x, z):
        return np.log(likelihood(x[0], z))

    def source(self, z):
        return "line"

    def readings(self, z):
        return 1.0


class Anywhere:
    def sample(self, draws, first, n):
        return HALF * (2.0 * draws.uniform(Stream.RANDOM_POSE, first, n)[:1] - 1.0)

    def log_density(self, x):
        return np.where(np.abs(x[0]) <= HALF, -np.log(2.0 * HALF), -np.inf)

    def log_prior(self, x):
        return np.where(np.abs(x[0]) <= HALF, 0.0, -np.inf)


class Found:
    """A density like p(z | x)/π(z), but wider, and with a floor."""

    log_pi = 0.0

    def __init__(self, z):
        self.z = z

    def sample(self, draws, first, n):
        which, place, _, _ = draws.uniform(Stream.TREE, first, n)
        near = self.z + 1.5 * MEASURED * draws.normal(Stream.TREE, first + 10**6, n)[0]
        x = np.where(which < 0.6, near, near - APART)
        return np.where(which > 0.9, HALF * (2.0 * place - 1.0), x)[None]

    def log_density(self, x):
        wide = 1.5 * MEASURED
        near = 0.6 * bell(x[0] - self.z, wide) + 0.3 * bell(x[0] - self.z + APART, wide)
        return np.log(near + np.where(np.abs(x[0]) <= HALF, 0.1 / (2.0 * HALF), 1e-300))


class Sampler:
    def given(self, z, draws):
        return Found(z)


def exact(alpha, uniform):
    """Density on the grid after all steps, and the evidence of each."""
    step = GRID[1] - GRID[0]
    bel = np.full(len(GRID), 1.0 / (2.0 * HALF)) if uniform else bell(GRID, 0.3)
    evidence = []
    for u, z in zip(MOVES, SEEN, strict=True):
        moved = bell(GRID[:, None] - GRID[None, :] - u, MOVED) @ bel * step
        joint = ((1.0 - alpha) * moved + alpha / (2.0 * HALF)) * likelihood(GRID, z)
        evidence.append(joint.sum() * step)
        bel = joint / evidence[-1]
    return bel, evidence


def line(proposal, n, alpha=ALPHA):
    return ParticleFilter(
        Drive(),
        Place(),
        Anywhere(),
        (Part(1.0, proposal, Fixed(n)),),
        RandomParticles(share=alpha, doubt_below=0.0),
        LINE,
    )


def balanced():
    """Under one density."""
    return Mixture(Sampler(), Systematic(), way=WAY)


def relocating(n, keeping=None):
    """Each term of the dynamics by itself; α is not held down."""
    return Relocating(Sampler(), particles=n, carried_off=1.0, keeping=keeping or Systematic())


BOTH = pytest.mark.parametrize(
    ("proposal", "tolerance"),
    [
        (lambda n: balanced(), 0.02),  # for the tree's own error
        (relocating, 0.0),
        (lambda n: relocating(n, Tempered()), 0.0),
    ],
    ids=["balanced", "relocating", "tempered"],
)


def mass_near(particles, place, within=1.0):
    return float(particles.weights[np.abs(particles.states[0] - place) < within].sum())


def exact_near(bel, place, within=1.0):
    return float(bel[np.abs(GRID - place) < within].sum() * (GRID[1] - GRID[0]))


class Given:
    """A start that is known."""

    def sample(self, draws, first, n):
        return 0.3 * draws.normal(Stream.RANDOM_POSE, first, n)[:1]


def finals(proposal, n, repeats, uniform):
    """(repeats, 2): mass at the true place and at its alias after the kidnapping; log evidences."""
    masses, evidences = [], []
    for seed in range(repeats):
        robot = line(proposal, n)
        bel = robot.start(robot.environment if uniform else Given(), Draws(seed))
        found = []
        for step, (u, z) in enumerate(zip(MOVES, SEEN, strict=True), 1):
            bel, info = robot.step(bel, u, z, Draws(seed, step))
            found.append(info.log_evidence)
        masses.append([mass_near(bel.particles, p) for p in (SEEN[-1], SEEN[-1] - APART)])
        evidences.append(found)
    return np.array(masses), np.array(evidences)


@BOTH
@pytest.mark.parametrize("uniform", [True, False], ids=["global", "known-start"])
def test_the_belief_is_that_of_bayes_also_after_a_kidnapping(uniform, proposal, tolerance):
    """Means of 60 runs within 4.5 standard errors, plus 1 % for the bias of ratios, which falls as
    1 / N.
    """
    bel, _ = exact(ALPHA, uniform)
    masses, _ = finals(proposal(1000), 1000, 60, uniform)
    for k, place in enumerate((SEEN[-1], SEEN[-1] - APART)):
        expected = exact_near(bel, place)
        error = masses[:, k].std() / np.sqrt(len(masses))
        assert masses[:, k].mean() == pytest.approx(expected, abs=4.5 * error + 0.01 + tolerance)


@BOTH
def test_it_needs_fewer_particles_than_random_ones(proposal, tolerance):
    """With 50 particles, of which random ones hardly meet the true place, but the scan does."""
    bel, _ = exact(ALPHA, False)
    expected = exact_near(bel, SEEN[-1])
    assert expected > 0.5
    error = {}
    for name, drawn_by in (("scan", proposal(50)), ("random", Forward(Systematic()))):
        masses, _ = finals(drawn_by, 50, 100, False)
        error[name] = float(np.mean((masses[:, 0] - expected) ** 2))
    assert error["scan"] < 0.25 * error["random"]


@BOTH
@pytest.mark.parametrize("uniform", [True, False], ids=["global", "known-start"])
def test_the_mean_weight_estimates_the_evidence(uniform, proposal, tolerance):
    """Of all steps, the product of whose estimates has no bias."""
    _, expected = exact(ALPHA, uniform)
    _, found = finals(proposal(500), 500, 100, uniform)
    first = np.exp(found[:, 0])
    assert first.mean() == pytest.approx(
        expected[0], abs=4.5 * first.std() / 10.0 + tolerance * expected[0]
    )
    if tolerance == 0.0:
        product, whole = np.exp(found.sum(axis=1)), np.prod(expected)
        assert product.mean() == pytest.approx(whole, abs=4.5 * product.std() / 10.0)


@BOTH
def test_a_filter_that_does_not_search_does_what_mcl_does(proposal, tolerance):
    mixture, mcl = (line(p, 200, alpha=0.0) for p in (proposal(300), Forward(Systematic())))
    one, other = (f.start(Given(), Draws(3)) for f in (mixture, mcl))
    for step, (u, z) in enumerate(zip(MOVES, SEEN, strict=True), 1):
        one, _ = mixture.step(one, u, z, Draws(3, step))
        other, _ = mcl.step(other, u, z, Draws(3, step))
        assert (one.particles.states == other.particles.states).all()
        assert (one.particles.log_weights == other.particles.log_weights).all()


@BOTH
def test_an_alias_is_believed_no_more_than_it_deserves(proposal, tolerance):
    """A known place, scans that also fit 7 m to the left: what q̄ proposes there has weight α U."""
    robot = line(proposal(2000), 2000)
    bel = ParticleBelief(Particles.equal(0.1 * np.random.default_rng(0).standard_normal((1, 2000))))
    bel, _ = robot.step(bel, 0.0, 0.0, Draws(1, 1))
    step = GRID[1] - GRID[0]
    moved = bell(GRID, np.hypot(0.1, MOVED))
    joint = ((1.0 - ALPHA) * moved + ALPHA / (2.0 * HALF)) * likelihood(GRID, 0.0)
    expected = exact_near(joint / joint.sum() / step, -APART)
    assert expected < 0.01
    assert mass_near(bel.particles, -APART) == pytest.approx(expected, rel=0.3)
