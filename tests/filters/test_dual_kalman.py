"""Dual MCL with Gaussian noise, on a line and in space, against the Kalman filter: how fast each
way to weigh comes near to it.

Moves, measurements and the start are the same and independent along each axis.
"""

from dataclasses import dataclass

import numpy as np
import pytest

from mcloc.density_tree import DensityTree
from mcloc.draws import Draws, Stream
from mcloc.filters.particle_filter import Part, ParticleFilter
from mcloc.proposals.dual import Dual
from mcloc.proposals.predictive import BackwardTree, ForwardTree, Pairs
from mcloc.sample_size import Fixed
from mcloc.statespace import LINE, R3

MOVES = (1.0, 0.5, -2.0, 1.0, 0.3)
SEEN = (1.3, 1.4, -0.2, 0.9, 0.6)
START = 1.0  # m, deviation at the start
MOVED = 0.5  # m, of each move
MEASURED = 0.7  # m, of each measurement
WAYS = ["pairs", "forward tree", "backward tree"]


def log_normal(e, sd):
    return -(0.5 * (e / sd) ** 2 + np.log(sd * np.sqrt(2.0 * np.pi))).sum(axis=0)


@dataclass(frozen=True)
class Bell:
    """A Gaussian around a place. As an environment it says only where robots start."""

    d: int
    mean: float
    sd: float
    log_pi = 0.0

    def sample(self, draws, first, n):
        return self.mean + self.sd * draws.normal(Stream.RANDOM_POSE, first, n)[: self.d]

    def log_density(self, x):
        return log_normal(x - self.mean, self.sd)

    def log_prior(self, x):
        return np.zeros(x.shape[1])


class Drive:
    def sample(self, x, u, draws, first):
        return x + u + MOVED * draws.normal(Stream.MOTION, first, x.shape[1])[: len(x)]

    def sample_previous(self, x_new, u, draws, first):
        return self.sample(x_new, -u, draws, first)

    def log_density(self, x_new, u, x):
        return log_normal(x_new - x - u, MOVED)

    def log_pi(self, x_new, u):
        return np.zeros(x_new.shape[1])

    def doubted(self):
        return self


class Place:
    def log_likelihood(self, x, z):
        return log_normal(x - z, MEASURED)

    def source(self, z):
        return "place"

    def readings(self, z):
        return 1.0


@dataclass(frozen=True)
class Sampler:
    """q̄ = p(z | x) / π(z), exactly."""

    d: int

    def given(self, z, draws):
        return Bell(self.d, z, MEASURED)


def dual(way, space):
    def tree(particles):
        return DensityTree.fit(particles, space, floor=0.0)

    ways = {"pairs": Pairs(), "forward tree": ForwardTree(fit=tree)}
    return Dual(Sampler(space.dimension), ways.get(way, BackwardTree(tree)))


def kalman(steps, d):
    """Mean and variance along each axis, and log p(z_1 … z_t)."""
    mean, variance, evidence = 0.0, START**2, 0.0
    for u, z in zip(MOVES[:steps], SEEN[:steps], strict=True):
        mean, variance = mean + u, variance + MOVED**2
        gain = variance / (variance + MEASURED**2)
        off = np.array([z - mean])
        evidence += d * float(log_normal(off, np.sqrt(variance + MEASURED**2)))
        mean, variance = mean + gain * (z - mean), (1.0 - gain) * variance
    return mean, variance, evidence


def squared_errors(way, space, n, steps, repeats):
    """(3, repeats): of the mean and the variance, averaged over axes, and of the evidence, as a
    share of it.
    """
    d = space.dimension
    size, start = Fixed(n), Bell(d, 0.0, START)
    robot = ParticleFilter(
        Drive(), Place(), start, (Part(1.0, dual(way, space), size),), space=space
    )
    mean, variance, evidence = kalman(steps, d)
    errors = np.empty((3, repeats))
    for seed in range(repeats):
        # Not the environment itself: the robot's start is known.
        bel, found = robot.start(Bell(d, 0.0, START), Draws(seed)), 0.0
        for step, (u, z) in enumerate(zip(MOVES[:steps], SEEN[:steps], strict=True), 1):
            bel, info = robot.step(bel, u, z, Draws(seed, step))
            found += info.log_evidence
        x, w = bel.particles.states, bel.particles.weights
        middle = x @ w
        spread = (x - middle[:, None]) ** 2 @ w
        errors[0, seed] = np.mean((middle - mean) ** 2)
        errors[1, seed] = np.mean((spread - variance) ** 2)
        errors[2, seed] = np.expm1(found - evidence) ** 2
    return errors


@pytest.mark.parametrize("way", WAYS)
def test_on_a_line_mean_and_variance_fall_as_root_n(falls_as_root_n, way):
    """What a tree smooths within a leaf costs N^(−2/3) there, which particles' own errors hide."""
    sizes = (64, 512, 4096)
    errors = [squared_errors(way, LINE, n, len(MOVES), 200) for n in sizes]
    for k in range(2):
        falls_as_root_n(sizes, [e[k] for e in errors])


@pytest.mark.parametrize("way", WAYS)
def test_in_space_mean_and_variance_fall_as_root_n(falls_as_root_n, way):
    """As long as leaves are narrow beside the belief; here up to 32,000 particles."""
    sizes = (500, 4000, 32_000)
    errors = [squared_errors(way, R3, n, 1, 100) for n in sizes]
    for k in range(2):
        falls_as_root_n(sizes, [e[k] for e in errors])


@pytest.mark.parametrize("way", WAYS)
def test_in_space_the_evidence_falls_at_the_rate_of_trees(fitted_slope, way):
    """Without trees as N^(−1/2). With them as N^(−2/(D+2)) where leaves are narrow beside the
    likelihood, as N^(−1/(D+2)) at the edges, where they are wide: between −2/5 and −1/5, told from
    −1/2 and 0. Within 3.5 standard errors.
    """
    sizes = (500, 4000, 32_000)
    errors = [squared_errors(way, R3, n, 1, 100)[2] for n in sizes]
    slope, error = fitted_slope(sizes, errors)
    assert error < 0.028
    if way == "pairs":
        assert slope == pytest.approx(-0.5, abs=3.5 * error)
    else:
        assert -0.4 - 3.5 * error < slope < -0.2 + 3.5 * error
