"""The holonomic model's own: noise along the way, across it, and turning, each as it says.

Its density and samples: test_left_invariant.py.
"""

import numpy as np
import pytest
from scipy.stats import kstest, multivariate_normal, norm

from mcloc.draws import Draws
from mcloc.motion import OmnidirectionalMotion

MOTION = OmnidirectionalMotion(
    alpha1=0.1, alpha2=0.2, alpha3=0.3, alpha4=0.4, alpha5=0.5, sigma_rot_min=0.01,
    sigma_trans_min=0.02,
)  # fmt: skip
U = np.array([0.6 * np.cos(2.0), 0.6 * np.sin(2.0), -0.3])
SD = (
    np.sqrt((0.3 * 0.6) ** 2 + (0.4 * 0.3) ** 2 + 0.02**2),
    np.sqrt((0.5 * 0.6) ** 2 + (0.4 * 0.3) ** 2 + 0.02**2),
    np.sqrt((0.1 * 0.3) ** 2 + (0.2 * 0.6) ** 2 + 0.01**2),
)
ORIGIN = np.zeros((3, 1))


def test_deviations_add_in_quadrature():
    """As the docstring has them: α are deviations per unit of motion."""
    d = MOTION.decompose(U)
    assert (d.sd_trans, d.sd_strafe, d.sd_rot) == pytest.approx(SD)


def test_errors_along_across_and_turning_are_independent_normals():
    """Kolmogorov–Smirnov for each, and correlations within 4.5 of their deviations 1/√n."""
    n = 20_000
    moved = MOTION.sample(np.zeros((3, n)), U, Draws(4, 1), 0)
    way = (moved[0] + 1j * moved[1]) * np.exp(-2.0j)
    errors = np.stack([way.real - 0.6, way.imag, moved[2] + 0.3]) / np.array(SD)[:, None]
    for error in errors:
        assert kstest(error, norm.cdf).pvalue > 1e-4
    off_diagonal = np.corrcoef(errors)[np.triu_indices(3, 1)]
    assert np.abs(off_diagonal).max() < 4.5 / np.sqrt(n)


def test_the_density_is_that_of_a_turned_gaussian():
    """SciPy's, where deviations in θ do not reach around the circle."""
    turn = np.array([[np.cos(2.0), -np.sin(2.0)], [np.sin(2.0), np.cos(2.0)]])
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = turn @ np.diag(np.square(SD[:2])) @ turn.T
    covariance[2, 2] = SD[2] ** 2
    x = U[:, None] + np.random.default_rng(0).uniform(-0.5, 0.5, (3, 200))
    expected = multivariate_normal(U, covariance).logpdf(x.T)
    assert MOTION.log_density(x, U, ORIGIN) == pytest.approx(expected)


def test_at_rest_no_direction_is_preferred():
    x = np.stack([0.03 * np.cos(np.arange(7.0)), 0.03 * np.sin(np.arange(7.0)), np.zeros(7)])
    density = MOTION.log_density(x, np.zeros(3), ORIGIN)
    assert density == pytest.approx(np.full(7, density[0]))


def test_a_reversed_way_is_as_likely_as_it_says():
    """At ∓ the way, far from the other mean: the densities are in the ratio of the chances."""
    motion = OmnidirectionalMotion(p_reverse=0.2)
    meant, reversed_ = (motion.log_density(s * U[:, None] * [[1], [1], [s]], U, ORIGIN)
                        for s in (1.0, -1.0))  # fmt: skip
    assert np.exp(reversed_ - meant) == pytest.approx(0.2 / 0.8)
