"""The velocity model's own: arcs, their limits, their deviations, and many ways to one place.

Its density and samples: test_left_invariant.py.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from mcloc.draws import Draws
from mcloc.motion import VelocityMotion

MOTION = VelocityMotion(
    alpha1=0.1, alpha2=0.2, alpha3=0.3, alpha4=0.4, alpha5=0.5, alpha6=0.6, sigma_rot_min=0.01,
    sigma_trans_min=0.02,
)  # fmt: skip
ORIGIN = np.zeros((3, 1))


def driven(length, turn, last=0.0):
    """Where an arc leads [Probabilistic Robotics, Table 5.3], a straight one too."""
    if turn == 0.0:
        return np.array([length, 0.0, last])
    radius = length / turn
    versine = 2.0 * np.sin(0.5 * turn) ** 2  # 1 − cos, without losing what a small turn leaves
    return np.array([radius * np.sin(turn), radius * versine, turn + last])


@given(
    st.floats(0.05, 3.0) | st.floats(-3.0, -0.05),
    st.floats(-3.0, 3.0, allow_subnormal=False),
    st.floats(-0.1, 0.1, allow_subnormal=False),
)
def test_an_arc_is_found_again(length, turn, last):
    arc = MOTION.decompose(driven(length, turn, last))
    assert (arc.length, arc.turn, arc.last) == pytest.approx((length, turn, last), abs=1e-9)


@pytest.mark.parametrize("turn", [1e-9, -1e-9, 1e-160])
def test_an_arc_that_hardly_turns_is_a_line(turn):
    """Decomposed, sampled and weighed: all go over into those of the line."""
    straight, curved = driven(0.8, 0.0), driven(0.8, turn)
    a, b = MOTION.decompose(straight), MOTION.decompose(curved)
    assert (b.length, b.sd_length, b.sd_turn, b.sd_last) == pytest.approx(
        (a.length, a.sd_length, a.sd_turn, a.sd_last)
    )
    still = np.zeros((3, 100))
    moved = [MOTION.sample(still, u, Draws(1), 0) for u in (straight, curved)]
    assert moved[1] == pytest.approx(moved[0], abs=1e-8)
    x = np.stack([np.linspace(0.5, 1.1, 9), np.zeros(9), np.zeros(9)])
    density = [MOTION.log_density(x, u, ORIGIN) for u in (straight, curved)]
    assert density[1] == pytest.approx(density[0], abs=1e-6)


@pytest.mark.parametrize("turn", [1.3, -2.9, np.pi])
def test_turning_on_the_spot_is_an_arc_of_no_length(turn):
    arc = MOTION.decompose(np.array([0.0, 0.0, turn]))
    assert (arc.length, arc.turn, arc.last) == (0.0, turn, 0.0)
    assert arc.sd_turn == pytest.approx(np.hypot(0.4 * turn, 0.01))
    moved = MOTION.sample(np.zeros((3, 500)), np.array([0.0, 0.0, turn]), Draws(2), 0)
    # The place errs by what the wheels may have driven while turning, 6 deviations at most.
    assert np.hypot(moved[0], moved[1]).max() < 6.0 * np.hypot(0.2 * turn, 0.02)


def test_deviations_add_in_quadrature():
    """As the docstring has them: α are deviations per unit of motion."""
    a = MOTION.decompose(driven(0.7, 0.9, -0.2))
    assert a.sd_length**2 == pytest.approx((0.1 * 0.7) ** 2 + (0.2 * 1.1) ** 2 + 0.02**2)
    assert a.sd_turn**2 == pytest.approx((0.3 * 0.7) ** 2 + (0.4 * 0.9) ** 2 + 0.01**2)
    assert a.sd_last**2 == pytest.approx((0.5 * 0.7) ** 2 + (0.6 * 1.1) ** 2 + 0.01**2)


def test_a_robot_that_backs_up_does_not_drive_around():
    a = MOTION.decompose(np.array([-0.5, 0.05, 0.1]))
    assert a.length < 0.0
    assert abs(a.turn) < 0.3


def test_the_density_at_a_point_is_that_of_the_arc_over_the_jacobian():
    """Where one arc alone leads: normals of s, φ, γ, over |∂(x, y)/∂(s, φ)| by differences."""
    u = driven(0.7, 0.9, -0.2)
    arc, s, phi, gamma = MOTION.decompose(u), 0.72, 0.8, -0.1
    h = 1e-6
    by_length = (driven(s + h, phi) - driven(s - h, phi))[:2] / (2.0 * h)
    by_turn = (driven(s, phi + h) - driven(s, phi - h))[:2] / (2.0 * h)
    jacobian = abs(np.linalg.det(np.stack([by_length, by_turn])))
    expected = (
        norm.logpdf(s, arc.length, arc.sd_length)
        + norm.logpdf(phi, arc.turn, arc.sd_turn)
        + norm.logpdf(gamma, arc.last, arc.sd_last)
        - np.log(jacobian)
    )
    found = MOTION.log_density(driven(s, phi, gamma)[:, None], u, ORIGIN)
    assert found == pytest.approx(expected, abs=1e-6)


def test_arcs_that_turn_further_are_counted_too():
    """A robot that turns by 2.8 rad, give or take one: many arcs turn by more than π."""
    motion = VelocityMotion(alpha4=0.35, sigma_trans_min=0.08, sigma_rot_min=0.2)
    u = driven(1.5, 2.8)
    moved = motion.sample(np.zeros((3, 20_000)), u, Draws(5), 0)
    # An arc of φ > π beyond the half circle lies to the left of the robot's start, behind it.
    behind = (moved[0] < 0.0) & (moved[1] > 0.0)
    r, a, theta = (
        (np.arange(n) + 0.5) / n * span
        for n, span in ((40, 2.2), (40, np.pi / 2), (60, 2.0 * np.pi))
    )
    rr, aa, tt = (v.ravel() for v in np.meshgrid(r, a, theta, indexing="ij"))
    places = np.stack([-rr * np.cos(aa), rr * np.sin(aa), np.pi - tt])
    density = np.exp(motion.log_density(places, u, ORIGIN))
    share = np.sum(density * rr) * 2.2 * np.pi / 2 * 2.0 * np.pi / (40 * 40 * 60)
    assert behind.mean() == pytest.approx(share, abs=4.5 * np.sqrt(share / 20_000))
