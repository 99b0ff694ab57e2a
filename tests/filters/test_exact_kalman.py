"""The particle filter on a line with Gaussian noise against the Kalman filter."""

import numpy as np
import pytest

from mcloc.draws import Draws, Stream
from mcloc.filters.particle_filter import Part, ParticleFilter
from mcloc.proposals.forward import Forward
from mcloc.resampling import Systematic, when_ess_below
from mcloc.sample_size import KLD, Fixed
from mcloc.statespace import LINE

MOVES = (1.0, 0.5, -2.0, 1.0, 0.3)
SEEN = (1.3, 1.4, -0.2, 0.9, 0.6)
START = 1.0  # m, deviation at the start
MOVED = 0.5  # m, of each move
MEASURED = 0.7  # m, of each measurement


class Drive:
    def sample(self, x, u, draws, first):
        return x + u + MOVED * draws.normal(Stream.MOTION, first, x.shape[1])[:1]

    def doubted(self):
        return self


class Place:
    def log_likelihood(self, x, z):
        return -0.5 * ((x[0] - z) / MEASURED) ** 2

    def source(self, z):
        return "tile"

    def readings(self, z):
        return 1.0


class Start:
    def sample(self, draws, first, n):
        return START * draws.normal(Stream.RANDOM_POSE, first, n)[:1]

    def log_density(self, x):
        return -0.5 * (x[0] / START) ** 2

    def log_prior(self, x):
        return np.zeros(x.shape[1])


def kalman():
    mean, variance = 0.0, START**2
    for u, z in zip(MOVES, SEEN, strict=True):
        mean, variance = mean + u, variance + MOVED**2
        gain = variance / (variance + MEASURED**2)
        mean, variance = mean + gain * (z - mean), (1.0 - gain) * variance
    return mean, variance


def run(line, seed):
    """Mean and variance of the last belief, and the particles used a step."""
    bel, used = line.start(Start(), Draws(seed)), 0
    for step, (u, z) in enumerate(zip(MOVES, SEEN, strict=True), 1):
        bel, info = line.step(bel, u, z, Draws(seed, step))
        used += info.n
    x, w = bel.particles.states[0], bel.particles.weights
    mean = x @ w
    return mean, (x - mean) ** 2 @ w, used / len(MOVES)


def pinned(n):
    return KLD(minimum=n, maximum=n)


CASES = {
    "fixed": (Fixed, Systematic()),
    "adaptive, when ess below": (pinned, when_ess_below(0.5, Systematic())),
    "kld": (lambda n: KLD(epsilon=16.0 / n, minimum=10), Systematic()),
}


@pytest.mark.parametrize(("size", "resampler"), CASES.values(), ids=CASES)
def test_mean_and_variance_fall_as_root_n(falls_as_root_n, size, resampler):
    mean, variance = kalman()
    sizes, of_mean, of_variance = [], [], []
    for n in (64, 512, 4096):
        part = Part(1.0, Forward(resampler), size(n))
        line = ParticleFilter(Drive(), Place(), Start(), (part,), space=LINE)
        found = np.array([run(line, seed) for seed in range(200)])
        of_mean.append((found[:, 0] - mean) ** 2)
        of_variance.append((found[:, 1] - variance) ** 2)
        sizes.append(found[:, 2].mean())
    assert sizes[-1] > 20 * sizes[0]
    falls_as_root_n(sizes, of_mean)
    falls_as_root_n(sizes, of_variance)
