"""Hypotheses: two modes are two, one is one, angles are averaged around the circle."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest

from mcloc.estimate import LEAST_SHARE, away, cluster, hypotheses
from mcloc.geometry import wrap
from mcloc.particles import Particles
from mcloc.sample_size import KLD
from mcloc.statespace import LINE, SE2

N = 4000


def cloud(rng, mean, sigma, n=N):
    x = np.array(mean)[:, None] + np.array(sigma)[:, None] * rng.standard_normal((3, n))
    x[2] = wrap(x[2])
    return x


def test_two_identical_corridors_are_two_hypotheses():
    """One pose in each of two places 5 m apart; their mean would lie in the wall between."""
    rng = np.random.default_rng(0)
    sigma = (0.3, 0.1, 0.1)
    x = np.concatenate(
        [cloud(rng, (2.0, 1.0, 0.5), sigma), cloud(rng, (2.0, 6.0, 0.5), sigma)], axis=1
    )
    found = hypotheses(Particles.equal(x), SE2)
    assert len(found) == 2
    for h, y in zip(sorted(found, key=lambda h: h.mean[1]), (1.0, 6.0), strict=True):
        assert h.share == pytest.approx(0.5, abs=0.1)
        assert np.hypot(*(h.mean[:2] - (2.0, y))) < 0.3
        assert h.mean[2] == pytest.approx(0.5, abs=0.05)


def test_opposite_headings_in_one_place_are_two_hypotheses():
    rng = np.random.default_rng(1)
    sigma = (0.1, 0.1, 0.1)
    x = np.concatenate(
        [cloud(rng, (0, 0, 0.4), sigma), cloud(rng, (0, 0, 0.4 - np.pi), sigma, N // 3)], axis=1
    )
    found = hypotheses(Particles.equal(x), SE2)
    assert [h.share for h in found] == pytest.approx([0.75, 0.25], abs=0.02)
    assert [h.mean[2] for h in found] == pytest.approx([0.4, 0.4 - np.pi], abs=0.02)


SPREADS = [(0.05, 0.05, 0.02), (0.5, 0.5, 0.3), (4.0, 0.15, 0.05), (0.05, 3.0, 0.3)]


@pytest.mark.parametrize("sigma", SPREADS, ids=str)
@pytest.mark.parametrize("turn", [0.0, 0.6])
def test_one_elongated_belief_is_one_hypothesis(sigma, turn):
    """With as many particles as KLD-sampling gives it, it holds what the NEES asks for, 95 %."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        x = cloud(rng, (0.0, 0.0, 0.3), sigma, 100_000)
        x[:2] = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ x[:2]
        n = KLD().counter(SE2, 0, 0).enough(x, np.zeros(x.shape[1]))
        assert hypotheses(Particles.equal(x[:, :n]), SE2)[0].share > 0.95


def test_moments_are_those_of_the_particles():
    """All particles are one mode: weighted mean and covariance by NumPy."""
    rng = np.random.default_rng(2)
    x = cloud(rng, (3.0, -2.0, 0.2), (0.1, 0.12, 0.05))
    particles = Particles.normalized(x, rng.uniform(-1.0, 0.0, N))
    (h,) = hypotheses(particles, SE2)
    w = particles.weights
    assert h.share == pytest.approx(1.0)
    assert h.mean[:2] == pytest.approx(x[:2] @ w)
    # At 0.05 rad circular and plain mean differ by a sixth of the third moment, < 1e-4.
    assert h.mean[2] == pytest.approx(x[2] @ w, abs=1e-4)
    expected = np.cov(x, aweights=w, bias=True)
    assert h.covariance == pytest.approx(expected, abs=1e-4 * 0.01)
    assert h.covariance == pytest.approx(h.covariance.T)


@pytest.mark.parametrize("heading", [np.pi, -np.pi + 0.01, 0.0, np.pi / 2])
def test_headings_are_averaged_around_the_circle(heading):
    rng = np.random.default_rng(3)
    found = hypotheses(Particles.equal(cloud(rng, (0.0, 0.0, heading), (0.1, 0.1, 0.2))), SE2)
    assert len(found) == 1
    # 4000 headings, deviation 0.2: mean to 0.2/√4000 = 0.0032, variance to 0.04 √(2/4000) = 0.0009.
    assert wrap(found[0].mean[2] - heading) == pytest.approx(0.0, abs=4.5 * 0.0032)
    assert -np.pi < found[0].mean[2] <= np.pi
    assert found[0].covariance[2, 2] == pytest.approx(0.04, abs=4.5 * 0.0009)


def test_a_line_has_hypotheses_too():
    x = np.concatenate([np.full(30, 2.0), np.full(70, 9.0)])[None]
    found = hypotheses(Particles.equal(x), LINE)
    assert [(h.mean[0], h.share) for h in found] == [
        pytest.approx((9.0, 0.7)),
        pytest.approx((2.0, 0.3)),
    ]


def test_shares_are_ranked_and_sum_to_at_most_one():
    rng = np.random.default_rng(4)
    x = rng.uniform(0.0, [[30.0], [30.0], [np.pi]], (3, 300))
    particles = Particles.normalized(x, 3.0 * rng.standard_normal(300))
    shares = [h.share for h in hypotheses(particles, SE2)]
    assert shares == sorted(shares, reverse=True)
    assert sum(shares) <= 1.0 + 1e-12
    assert min(shares) >= LEAST_SHARE


def test_a_belief_spread_all_over_still_has_one():
    x = np.stack([np.arange(400.0), np.zeros(400), np.zeros(400)]) * 2.0
    found = hypotheses(Particles.equal(x), SE2)
    assert len(found) == 1
    assert found[0].share == pytest.approx(1 / 400)


def test_one_particle_is_a_hypothesis():
    (h,) = hypotheses(Particles.equal(np.array([[1.0], [2.0], [3.0]])), SE2)
    assert h.mean == pytest.approx([1.0, 2.0, 3.0])
    assert h.share == 1.0
    assert (h.covariance == 0.0).all()


def test_every_particle_is_in_one_cluster_whatever_the_order():
    rng = np.random.default_rng(5)
    x = np.concatenate(
        [cloud(rng, (k, -k, k), (0.2, 0.2, 0.2), 300) for k in range(0, 12, 3)], axis=1
    )
    labels = cluster(Particles.equal(x), SE2)
    order = rng.permutation(x.shape[1])
    shuffled = cluster(Particles.equal(x[:, order]), SE2)
    assert set(labels) == set(range(labels.max() + 1))
    assert len({*zip(labels[order], shuffled, strict=True)}) == labels.max() + 1


def test_away_is_the_share_that_is_farther_than_a_metre_from_the_mean():
    """Against exact sums; headings and their mean say nothing."""
    rng = np.random.default_rng(7)
    particles = Particles.normalized(
        cloud(rng, (40.0, -20.0, 3.0), (0.6, 0.4, 2.0)), rng.standard_normal(N)
    )
    w, (x, y, _) = particles.weights, particles.states
    middle = math.fsum(w * x), math.fsum(w * y)
    far = np.hypot(x - middle[0], y - middle[1]) > 1.0
    assert 0.05 < w[far].sum() < 0.5
    assert away(particles, SE2) == pytest.approx(w[far].sum(), abs=1e-12)
    one_place = Particles.equal(np.ones((3, N)) * np.array([[1e3], [1e3], [1.0]]))
    assert away(one_place, SE2) == 0.0


BESIDE = """
import numpy as np
from mcloc.estimate import away
from mcloc.filters.place_belief import _moments
from mcloc.particles import Particles
from mcloc.statespace import SE2

rng = np.random.default_rng(1)
for _ in range(20):
    half = rng.random(50_000)
    order = rng.permutation(100_000)
    x = np.zeros((3, 100_000))
    x[0] = np.repeat([6.0, 8.0], 50_000)[order]
    print(away(Particles.normalized(x, np.log(np.tile(half, 2)[order])), SE2))
mean, covariance = _moments(rng.normal(size=(3, 100_000)), rng.random(100_000))
print(mean.tobytes().hex(), covariance.tobytes().hex())
"""


def test_how_many_threads_linear_algebra_has_does_not_matter():
    """All particles are a metre from the mean: how it is rounded decides which are farther."""
    found = []
    for threads in ("1", "2", "3"):
        env = {**os.environ, "OPENBLAS_NUM_THREADS": threads, "OMP_NUM_THREADS": threads}
        made = subprocess.run(
            [sys.executable, "-c", BESIDE], env=env, capture_output=True, text=True, check=True
        )
        found.append(made.stdout)
    assert len(set(found[0].split()[:20])) > 1
    assert found[0] == found[1] == found[2]
