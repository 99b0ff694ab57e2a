"""Density trees come nearer to the true density with more samples, at the rate that they may."""

import numpy as np
import pytest

from mcloc.density_tree import DensityTree
from mcloc.draws import Draws
from mcloc.geometry import wrap
from mcloc.particles import Particles
from mcloc.statespace import LINE, SE2


def test_uniform_samples_get_back_what_they_are_uniform_on():
    """N samples stay L/(N + 1) away from either end of a length L, in the mean; its deviation is
    about as large.
    """
    n, repeats = 50, 400
    rng = np.random.default_rng(10)
    sides = [
        DensityTree.fit(Particles.equal(rng.random((1, n))), LINE).side[0] for _ in range(repeats)
    ]
    deviation = np.sqrt(2.0) / n / np.sqrt(repeats)
    assert abs(np.mean(sides) - 1.0) < 4.0 * deviation


def mean_error(space, n, repeats, leaf=None):
    """Mean of ∫ |p̂ − p| dx for a Gaussian p, from 4,000 samples of p: E |p̂/p − 1|."""
    d = space.dimension
    mean = np.array([3.0, -2.0, 3.0])[:d, None]  # the last near the seam
    deviation = np.array([0.5, 0.2, 0.1])[:d, None]
    rng = np.random.default_rng(11)

    def drawn(count):
        e = rng.normal(size=(d, count))
        x = mean + deviation * e
        x[np.array(space.circular)] = wrap(x[np.array(space.circular)])
        norm = np.prod(deviation * np.sqrt(2.0 * np.pi))
        return x, np.exp(-0.5 * (e**2).sum(axis=0)) / norm

    errors = []
    for _ in range(repeats):
        tree = DensityTree.fit(Particles.equal(drawn(n)[0]), space, floor=0.0, leaf=leaf)
        x, p = drawn(4000)
        errors.append(np.abs(np.exp(tree.log_density(x)) / p - 1.0).mean())
    return np.mean(errors)


@pytest.mark.parametrize("space", [LINE, SE2], ids=["line", "plane"])
def test_the_error_falls_at_the_rate_of_its_dimension(space):
    """As n^(−1/(D+2)). The sides of leaves are halved, so they may be √2 off the best in either
    direction, and by no more than that the error, at either n.
    """
    fallen = mean_error(space, 1000, 10) / mean_error(space, 64_000, 10)
    expected = 64.0 ** (1.0 / (space.dimension + 2))
    assert expected / np.sqrt(2.0) < fallen < expected * np.sqrt(2.0)


def test_the_error_stays_where_leaves_do_not_shrink():
    """What the bound above must tell apart: leaves that keep their share of the samples."""
    fallen = mean_error(SE2, 1000, 10, leaf=8) / mean_error(SE2, 64_000, 10, leaf=512)
    assert fallen < 64.0 ** (1.0 / 5.0) / np.sqrt(2.0)


@pytest.mark.parametrize("n", [1000, 20_000])
def test_nothing_lies_between_two_hills_at_opposite_ends(n):
    """Two places 22 m apart, each known to 0.1 m and 3°: what is more than 5 deviations from both
    has hardly any mass.
    """
    rng = np.random.default_rng(n)
    sigma = np.array([0.1, 0.1, np.deg2rad(3.0)])[:, None]
    centre = np.where(rng.random(n) < 0.5, 0.0, 1.0) * np.array([20.0, 9.0, 0.5])[:, None]
    x = centre + sigma * rng.standard_normal((3, n))
    tree = DensityTree.fit(Particles.equal(x), SE2, floor=0.0)
    drawn = tree.sample(Draws(1), 0, 20_000)
    away = [
        (np.abs(drawn - hill[:, None]) > 5.0 * sigma).any(axis=0)
        for hill in (np.zeros(3), np.array([20.0, 9.0, 0.5]))
    ]
    assert np.mean(away[0] & away[1]) < 0.01
