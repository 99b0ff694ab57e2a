"""NEES = eᵀ P⁻¹ e where one hypothesis holds the belief."""

import numpy as np
import pytest
from scipy.stats import chi2

from mcloc.evaluation import evaluate
from mcloc.geometry import wrap
from mcloc.trajectory import Trajectory

P = np.array([[0.04, 0.01, 0.002], [0.01, 0.09, -0.004], [0.002, -0.004, 0.01]])


def trajectory_with(
    errors: np.ndarray, covariances: np.ndarray, share: np.ndarray
) -> tuple[Trajectory, Trajectory]:
    """An estimate with these errors, and the truth: standing still, facing backwards (θ = π)."""
    n = len(errors)
    t = np.arange(float(n))
    truth = np.tile([1.0, 2.0, np.pi], (n, 1))
    estimate = truth + errors
    estimate[:, 2] = wrap(estimate[:, 2])
    return Trajectory(t, estimate, covariances, share), Trajectory(t, truth)


def nees(errors: np.ndarray, covariances: np.ndarray, share: np.ndarray) -> float | None:
    return evaluate(*trajectory_with(errors, covariances, share)).nees_median


def test_the_value_of_one_error_across_the_seam_of_the_heading() -> None:
    # 0.2² / 0.04 + 0.3² / 0.01 = 1 + 9
    one = nees(np.array([[0.2, 0.0, 0.3]]), np.diag([0.04, 1.0, 0.01])[None], np.ones(1))
    assert one == pytest.approx(10.0)


def test_correlations_count() -> None:
    e = np.array([0.1, -0.2, 0.05])
    assert nees(e[None], P[None], np.ones(1)) == pytest.approx(e @ np.linalg.inv(P) @ e)


@pytest.mark.parametrize(("scale", "expected"), [(1.0, 2.366), (0.5, 4.732), (2.0, 1.183)])
def test_the_median_over_many_errors_is_that_of_chi_squared(scale: float, expected: float) -> None:
    """P wrong by a factor shows as its inverse. The median of n draws has a standard deviation of
    1 / (2 f(m) √n), f the density there: 0.0212 for n = 20000 at P's own scale; the bound is 4."""
    n = 20_000
    m = chi2.median(df=3)
    bound = 4.0 / (2.0 * chi2.pdf(m, df=3) * np.sqrt(n))
    errors = np.random.default_rng(3).multivariate_normal(np.zeros(3), P, n)
    median = nees(errors, np.tile(scale * P, (n, 1, 1)), np.ones(n))
    assert median is not None
    assert median * scale == pytest.approx(m, abs=bound)
    assert m / scale == pytest.approx(expected, abs=1e-3)


def test_only_a_belief_with_one_hypothesis_counts() -> None:
    errors = np.array([[5.0, 0, 0], [0.2, 0, 0], [5.0, 0, 0]])
    covariances = np.tile(0.04 * np.eye(3), (3, 1, 1))
    assert nees(errors, covariances, np.array([0.95, 0.96, 0.5])) == pytest.approx(1.0)
    assert nees(errors, covariances, np.full(3, 0.95)) is None


@pytest.mark.parametrize(
    "unusable",
    [
        np.zeros((3, 3)),
        np.diag([1.0, 1.0, 0.0]),
        np.diag([1.0, -1.0, 1.0]),
        np.full((3, 3), np.nan),
    ],
)
def test_a_covariance_that_has_no_inverse_is_passed_over(unusable: np.ndarray) -> None:
    errors = np.array([[0.2, 0, 0], [3.0, 3.0, 3.0]])
    covariances = np.stack([0.04 * np.eye(3), unusable])
    assert nees(errors, covariances, np.ones(2)) == pytest.approx(1.0)
    assert nees(errors[1:], covariances[1:], np.ones(1)) is None


def test_without_covariances_or_shares_it_is_unknown() -> None:
    t, poses = np.arange(3.0), np.zeros((3, 3))
    reference = Trajectory(t, poses)
    covariances = np.tile(np.eye(3), (3, 1, 1))
    assert evaluate(Trajectory(t, poses, share=np.ones(3)), reference).nees_median is None
    assert evaluate(Trajectory(t, poses, covariances), reference).nees_median is None
