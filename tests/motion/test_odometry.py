"""The odometry model's decomposition; its density and samples: test_left_invariant.py."""

import numpy as np
import pytest

from mcloc.motion import OdometryMotion

NOISY = OdometryMotion(sigma_rot_min=0.15, sigma_trans_min=0.08)
MOVES = {
    "ahead": (0.6, 0.0, 0.0),
    "in a curve": (0.4, 0.3, 0.9),
    "backwards": (-0.5, 0.1, -0.3),
    "pure rotation": (0.0, 0.0, 1.2),
    "half a turn": (0.02, 0.01, np.pi),
    "at rest": (0.0, 0.0, 0.0),
}


@pytest.mark.parametrize("u", MOVES.values(), ids=MOVES)
def test_decomposition_leads_where_the_move_leads(u):
    d = NOISY.decompose(np.array(u))
    reached = d.trans * np.cos(d.rot1), d.trans * np.sin(d.rot1)
    # What is shorter than the noise of a robot at rest has no direction: its length alone is kept.
    lost = 0.0 if abs(d.trans) >= NOISY.sigma_trans_min else 2.0 * abs(d.trans)
    assert np.hypot(reached[0] - u[0], reached[1] - u[1]) <= lost + 1e-12
    assert np.exp(1j * (d.rot1 + d.rot2)) == pytest.approx(np.exp(1j * u[2]))


def test_a_robot_that_backs_up_does_not_turn_around():
    d = NOISY.decompose(np.array([-0.5, 0.05, 0.1]))
    assert d.trans < 0.0
    assert abs(d.rot1) < 0.2


def test_deviations_add_in_quadrature():
    """As the docstring has them: α are deviations per unit of motion."""
    m = OdometryMotion(
        alpha1=0.2, alpha2=0.3, alpha3=0.4, alpha4=0.5, sigma_rot_min=0.01, sigma_trans_min=0.02
    )
    u = np.array([0.6 * np.cos(0.7), 0.6 * np.sin(0.7), 0.2])
    d = m.decompose(u)
    assert d.sd_rot1**2 == pytest.approx((0.2 * 0.7) ** 2 + (0.3 * 0.6) ** 2 + 0.01**2)
    assert d.sd_rot2**2 == pytest.approx((0.2 * 0.5) ** 2 + (0.3 * 0.6) ** 2 + 0.01**2)
    assert d.sd_trans**2 == pytest.approx((0.4 * 0.6) ** 2 + (0.5 * 1.2) ** 2 + 0.02**2)
