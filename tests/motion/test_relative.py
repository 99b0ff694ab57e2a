"""How an object moves in the frame of a robot that moves: against rigid geometry, and the sampler
against its density.
"""

import numpy as np
import pytest
from scipy.stats import chisquare, kstest

from mcloc.draws import Draws
from mcloc.errors import ConfigError
from mcloc.geometry import between, compose
from mcloc.motion.relative import RelativeMotion, carried, carried_back

U = np.array([0.4, -0.3, 0.9])
X = np.random.default_rng(1).normal(0.0, 3.0, (3, 200))
MOTION = RelativeMotion(sigma=0.1)


def test_a_thing_that_stands_still_keeps_its_place_in_the_world():
    """Seen as a pose in the plane, its place is ⊖u ⊕ x."""
    poses = np.stack([X[0], X[1], np.zeros(200)], axis=-1)
    expected = between(np.broadcast_to(U, poses.shape), poses)
    moved = carried(X, U)
    assert moved[:2] == pytest.approx(expected[:, :2].T)
    assert (moved[2] == X[2]).all()
    back = np.stack([moved[0], moved[1], np.zeros(200)], axis=-1)
    assert compose(U, back)[:, :2] == pytest.approx(poses[:, :2])
    assert carried_back(moved, U) == pytest.approx(X)


def test_noise_is_normal_about_the_moved_place():
    x = np.broadcast_to(X[:, :1], (3, 20_000))
    e = (MOTION.sample(x, U, Draws(1, 2), 0) - carried(x, U)) / 0.1
    for k in range(3):
        assert kstest(e[k], "norm").pvalue > 1e-4
    assert np.abs(np.corrcoef(e) - np.eye(3)).max() < 4.5 / np.sqrt(20_000)


def test_the_density_is_that_of_the_samples():
    """χ² over shells: the squared distance from a density is found again in it."""
    x = np.broadcast_to(X[:, :1], (3, 20_000))
    log_p = MOTION.log_density(MOTION.sample(x, U, Draws(3), 0), U, x)
    best = MOTION.log_density(carried(x, U), U, x)[0]
    assert best == pytest.approx(-3.0 * np.log(0.1 * np.sqrt(2.0 * np.pi)))
    assert kstest(2.0 * (best - log_p), "chi2", args=(3,)).pvalue > 1e-4


def test_previous_places_have_the_density_of_moves_into_the_place():
    """p(x_new | u, x_{t−1}) / π over x_{t−1}: all directions alike, distances as in the moves."""
    x_new = np.broadcast_to(X[:, :1], (3, 20_000))
    old = MOTION.sample_previous(x_new, U, Draws(4), 0)
    log_p = MOTION.log_density(x_new, U, old)
    best = -3.0 * np.log(0.1 * np.sqrt(2.0 * np.pi))
    assert kstest(2.0 * (best - log_p), "chi2", args=(3,)).pvalue > 1e-4
    away = old - carried_back(x_new, U)
    octants = (away > 0.0).T @ [1, 2, 4]
    assert chisquare(np.bincount(octants, minlength=8)).pvalue > 1e-4


def test_pi_is_constant():
    """∫ p(x_new | u, x_{t−1}) dx_{t−1} = 1 by the midpoint rule."""
    x_new = X[:, :1]
    axis = 0.05 * (np.arange(28) - 13.5)
    around = np.stack(np.meshgrid(axis, axis, axis)).reshape(3, -1)
    log_p = MOTION.log_density(x_new, U, carried_back(x_new, U) + around)
    assert np.exp(log_p).sum() * 0.05**3 == pytest.approx(1.0, abs=1e-6)
    assert (MOTION.log_pi(X, U) == 0.0).all()
    assert MOTION.doubted() is MOTION


@pytest.mark.parametrize("way", ["sample", "sample_previous"])
def test_chunks_do_not_matter(way):
    move = getattr(MOTION, way)
    before = X.copy()
    whole = move(X, U, Draws(3, 2, 1), 40)
    parts = [move(X[:, a:b], U, Draws(3, 2, 1), 40 + a) for a, b in ((0, 1), (1, 77), (77, 200))]
    assert np.array_equal(whole, np.concatenate(parts, axis=1))
    assert np.array_equal(X, before)


def test_a_deviation_is_positive():
    with pytest.raises(ConfigError, match="sigma"):
        RelativeMotion(sigma=0.0)
