"""Dual MCL in the plane, in an empty room: what it believes is what many forward particles do; and
what it draws depends on the particle alone.

The robot is near a wall and the scan says that it may be in it, so p(x | m) matters.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from mcloc.density import Gaussian
from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.errors import ConfigError
from mcloc.filters.particle_filter import Part, ParticleBelief, ParticleFilter
from mcloc.filters.recovery import RandomParticles
from mcloc.geometry import compose, wrap
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.motion import OdometryMotion
from mcloc.particles import Particles
from mcloc.proposals.dual import Dual
from mcloc.proposals.forward import Forward
from mcloc.proposals.predictive import (
    BackwardTree,
    ForwardTree,
    Pairs,
    log_mixture,
    tree_of_poses,
)
from mcloc.proposals.target import Target
from mcloc.resampling import Systematic
from mcloc.sample_size import Fixed

BELIEVED = Gaussian(np.array([0.4, 2.5, 2.9]), np.diag([0.20, 0.15, 0.10]) ** 2)
SEEN = np.diag([0.1, 0.1, 0.08]) ** 2
MOVE = np.array([0.5, 0.1, 0.3])  # turns over the seam of the headings
POSE = compose(BELIEVED.mean, MOVE) + np.array([0.05, -0.05, 0.03])
WAYS = {"pairs": Pairs(), "forward tree": ForwardTree(), "backward tree": BackwardTree()}
every_way = pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)


def room(side):
    """An empty square of so many metres, the walls 0.5 m thick."""
    n = int(side / 0.1)
    cells = np.pad(np.full((n, n), FREE, dtype=np.int8), 5, constant_values=OCCUPIED)
    return FreeSpace(OccupancyGrid(cells, 0.1, np.array([-0.5, -0.5, 0.0])))


ROOM = room(5.0)


class Eye:
    """Sees where the robot is."""

    def log_likelihood(self, x, z):
        return Gaussian(z, SEEN).log_density(x)

    def source(self, z):
        return "eye"

    def readings(self, z):
        return 1.0


class Found(Gaussian):
    log_pi = 0.0


@dataclass(frozen=True)
class Sampler:
    """Poses around the one that is seen, by so much wider than the likelihood."""

    wider: float = 1.0

    def given(self, z, draws):
        return Found(z, self.wider * SEEN)


def target(believed=BELIEVED, n=20_000, seed=0, **changed):
    particles = Particles.equal(believed.sample(Draws(seed), 0, n))
    models = OdometryMotion(), Eye(), ROOM
    return replace(Target(particles, MOVE, POSE, 0.1, 0.3, *models), **changed)


def moments(weighed):
    """Mean, deviations, covariances, mass inside walls, and evidence."""
    p = np.exp(weighed.log_weights)
    evidence, p = p.mean(), p / p.sum()
    e = weighed.states - POSE[:, None]
    e[2] = wrap(e[2])
    mean = e @ p
    spread = ((e - mean[:, None]) * p) @ (e - mean[:, None]).T
    row, column = ROOM.grid.cell_of(weighed.states.T)
    inside = p @ ~ROOM.grid.free[row, column]
    return np.array(
        [*mean, *np.sqrt(np.diag(spread)), *spread[np.triu_indices(3, 1)], inside, evidence]
    )


def repeated(proposal, n, repeats):
    """Mean of the moments over seeds, and its standard error."""
    found = []
    for seed in range(repeats):
        source, _ = proposal.prepare(target(seed=seed), n, Draws(seed, 1))
        found.append(moments(source(0, n)))
    return np.mean(found, axis=0), np.std(found, axis=0) / np.sqrt(repeats)


@pytest.fixture(scope="module")
def forward():
    """By many forward particles."""
    return repeated(Forward(Systematic()), 100_000, 40)


@pytest.mark.parametrize("wider", [1.0, 2.0], ids=["q = p(z|x)/π(z)", "q wider"])
@every_way
def test_it_believes_what_many_forward_particles_do(forward, way, wider):
    """Within 4.5 standard errors of the difference, and for trees what leaves smooth.

    They hold ½ 20,000^(2/5) = 27 samples. Around the mean of a Gaussian such a part has sides of
    h = 0.28 σ, which adds h²/12 to the variance, 0.3 % to the deviation: of 0.2 m at most. The
    density itself, and so the evidence, is off by a share of 20,000^(−1/5) at most.
    """
    expected, error = forward
    found, own = repeated(Dual(Sampler(wider), way), 20_000, 40)
    bound = 4.5 * np.hypot(error, own)
    if not isinstance(way, Pairs):
        bound[:6] += 0.003 * 0.2
        bound[-1] += 20_000 ** (-1.0 / 5.0) * expected[-1]
    assert expected[-2] > 0.02  # there is mass inside walls, but little of what would be
    assert (np.abs(found - expected) < bound).all()


def test_most_pairs_weigh_nothing_where_the_robot_may_be_anywhere():
    """As the paper suspects [Fox01 §19.3.2]. Trees give every pose its due."""
    large, n = room(20.0), 5000
    particles = Particles.equal(large.sample(Draws(1), 0, n))
    middle = np.array([10.0, 10.0, 1.0])
    lost = target(particles=particles, environment=large, z=middle, alpha=0.0, doubt=0.0)
    found, ess = {}, {}
    for name, way in WAYS.items():
        source, _ = Dual(Sampler(), way).prepare(lost, n, Draws(2))
        weighed = source(0, n)
        found[name] = np.exp(weighed.log_before)
        ess[name] = Particles.normalized(weighed.states, weighed.log_weights).ess / n
    assert np.mean(found["pairs"] == 0.0) > 0.99
    assert ess["pairs"] < 0.002
    assert min(ess["forward tree"], ess["backward tree"]) > 0.8


@every_way
def test_chunks_make_no_difference(way):
    source, n = Dual(Sampler(), way).prepare(target(n=500), None, Draws(3, 2))
    assert n is None
    whole = source(10, 990)
    parts = [source(10 + a, b - a) for a, b in ((600, 990), (0, 1), (1, 600))]
    for one, rest in zip(whole, zip(*parts, strict=True), strict=True):
        last, *others = rest
        assert np.array_equal(one, np.concatenate([*others, last], axis=-1))


@every_way
def test_threads_make_no_difference(set_threads, way):
    """With more particles than a thread takes at a time."""
    before = ParticleBelief(Particles.equal(BELIEVED.sample(Draws(1), 0, 2000)))
    parts = (Part(1.0, Dual(Sampler(), way), Fixed(70_000)),)
    robot = ParticleFilter(OdometryMotion(), Eye(), ROOM, parts, RandomParticles(share=0.1))
    found = []
    for threads in (1, 3):
        set_threads(threads)
        found.append(robot.step(before, MOVE, POSE, Draws(3, 1))[0].particles)
    assert np.array_equal(found[0].states, found[1].states)
    assert np.array_equal(found[0].log_weights, found[1].log_weights)


@every_way
def test_a_single_particle(way):
    """Of the belief, and of the new one: it weighs at least what random particles do, which is
    nothing in walls. Products of three factors are rounded to within 1e-9.
    """
    one = target(n=1)
    for seed in range(20):
        source, _ = Dual(Sampler(), way).prepare(one, 1, Draws(seed, 1))
        x, before, _ = source(0, 1)
        random = np.log(0.1) + ROOM.log_density(x) + ROOM.log_prior(x)
        assert before[0] >= random[0] - Gaussian(POSE, SEEN).log_density(x)[0] - 1e-9


def test_a_tree_of_poses_says_nothing_where_no_pose_was():
    """No floor: what may be anywhere is α U, and no more."""
    x = BELIEVED.sample(Draws(1), 0, 2000)
    shift = np.array([[4.0], [2.0], [0.0]])
    tree = tree_of_poses(Particles.equal(np.concatenate([x, x + shift], axis=1)))
    leaves = tree.child == np.arange(len(tree.child), dtype=np.uint64)
    empty = leaves & (tree.weight == 0.0)
    assert empty.any()
    middle = (tree.corner + 0.5 * tree.width)[empty] * tree.side + tree.low
    assert (tree.log_density(middle.T) == -np.inf).all()


def test_three_uses_have_random_numbers_of_their_own():
    """The sampler, the poses and the way may each draw from any stream, in any part."""
    used = []

    class Watched(Sampler, Pairs):
        def given(self, z, draws):
            used.append(draws)
            return WatchedPoses(z, SEEN)

        def prepare(self, target, draws):
            used.append(draws)
            return Pairs.prepare(self, target, draws)

    class WatchedPoses(Found):
        def sample(self, draws, first, n):
            used.append(draws)
            return Found.sample(self, draws, first, n)

    for part in range(3):
        source, _ = Dual(Watched(), Watched()).prepare(target(n=5), 5, Draws(1, 1, part))
        source(0, 5)
    assert len(set(used)) == len(used) == 9
    assert {(d.seed, d.step) for d in used} == {(1, 1)}


@every_way
def test_where_nothing_is_known_poses_are_weighed_by_what_is_seen_alone(way):
    source, _ = Dual(Sampler(2.0), way).prepare(target(n=2, uniform=True), 200, Draws(3, 1))
    x, before, seen = source(0, 200)
    q = Gaussian(POSE, 2.0 * SEEN).log_density(x)
    assert np.array_equal(before, ROOM.log_prior(x) + ROOM.log_density(x) - q)
    assert np.array_equal(seen, Eye().log_likelihood(x, POSE))


def test_a_forward_tree_has_as_many_particles_as_are_asked_for():
    sizes = []

    def fit(particles):
        sizes.append(len(particles))
        return tree_of_poses(particles)

    for particles in (None, 70):
        way = ForwardTree(particles, fit)
        Dual(Sampler(), way).prepare(target(n=30), 10, Draws(1))
    assert sizes == [30, 70]
    with pytest.raises(ConfigError, match="at least 1"):
        ForwardTree(0)


def test_mixtures_of_nothing_and_of_everything():
    usual, other = np.array([-np.inf, 0.0, -np.inf]), np.array([-np.inf, -np.inf, 1.0])
    assert np.array_equal(log_mixture(0.0, usual, other), usual)
    assert np.array_equal(log_mixture(1.0, usual, other), other)
    half = np.array([-np.inf, -np.log(2.0), 1.0 - np.log(2.0)])
    assert log_mixture(0.5, usual, other) == pytest.approx(half)
