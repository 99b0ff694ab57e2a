"""The odometry model: a density that integrates to 1, samplers that agree with it, π = 1.

Integrals are taken in polar coordinates (r, a, θ) by the midpoint rule, which is exact for all
practical purposes on a smooth function around a circle, once cells are narrower than deviations.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.stats import chisquare

from mcloc.draws import Draws
from mcloc.geometry import between, compose, wrap
from mcloc.motion import OdometryMotion
from mcloc.statespace import LogWeights, States

NOISY = OdometryMotion(
    alpha1=0.2, alpha2=0.2, alpha3=0.2, alpha4=0.1, sigma_rot_min=0.15, sigma_trans_min=0.08
)
MODELS = {
    "sometimes reversed": replace(NOISY, p_reverse=0.3),
    "doubted": replace(NOISY, loose=2.0).doubted(),
}
MOVES = {
    "ahead": (0.6, 0.0, 0.0),
    "in a curve": (0.4, 0.3, 0.9),
    "backwards": (-0.5, 0.1, -0.3),
    "pure rotation": (0.0, 0.0, 1.2),
    "half a turn": (0.02, 0.01, np.pi),
    "at rest": (0.0, 0.0, 0.0),
}
X = np.array([[3.0], [-2.0], [2.8]])
CELLS = (60, 96, 96)
BLOCKS = (5, 12, 8)  # cells of a χ² test, each of 12 × 8 × 12 cells of the integral
N = 20_000


def integral(log_density: Callable[[States], LogWeights], at: States, reach: float):
    """Cells of ∫ p r dr da dθ over the places at distance r < reach in direction a from `at`."""
    r, a, theta = (
        (np.arange(n) + 0.5) / n * span
        for n, span in zip(CELLS, (reach, 2.0 * np.pi, 2.0 * np.pi), strict=True)
    )
    rr, aa, tt = (v.ravel() for v in np.meshgrid(r, a, theta, indexing="ij"))
    places = np.stack([at[0] + rr * np.cos(aa), at[1] + rr * np.sin(aa), wrap(tt)])
    volume = reach * (2.0 * np.pi) ** 2 / np.prod(CELLS)
    return (np.exp(log_density(places)) * rr * volume).reshape(CELLS)


def blocks(cells):
    """Sums over blocks of cells."""
    (r, a, t), (i, j, k) = CELLS, BLOCKS
    return cells.reshape(i, r // i, j, a // j, k, t // k).sum(axis=(1, 3, 5))


def counts(samples: States, at: States, reach: float):
    """How many samples fall into each block."""
    dx, dy = samples[0] - at[0], samples[1] - at[1]
    full = 2.0 * np.pi
    polar = np.stack([np.hypot(dx, dy), np.arctan2(dy, dx) % full, samples[2] % full])
    return np.histogramdd(polar.T, BLOCKS, [(0.0, reach), (0.0, full), (0.0, full)])[0]


def agree(observed, expected) -> float:
    """p-value of χ² over the blocks that expect 5 or more, the others put together."""
    enough = expected >= 5.0
    pooled = [np.append(v[enough], v[~enough].sum()) for v in (observed, expected)]
    return chisquare(pooled[0], pooled[1] * pooled[0].sum() / pooled[1].sum()).pvalue


CASES = {f"{name}": (NOISY, u) for name, u in MOVES.items()} | {
    f"{name}, in a curve": (motion, MOVES["in a curve"]) for name, motion in MODELS.items()
}


@pytest.mark.parametrize(("motion", "u"), CASES.values(), ids=CASES)
def test_forwards(motion, u):
    """∫ p(x_t | u, x_{t−1}) dx_t = 1, and `sample` draws from it."""
    u = np.array(u)
    reach = motion.decompose(u).sd_trans * 6.0 + np.hypot(u[0], u[1])
    cells = integral(lambda x: motion.log_density(x, u, X), X, reach)
    assert cells.sum() == pytest.approx(1.0, abs=1e-3)
    samples = motion.sample(np.repeat(X, N, axis=1), u, Draws(1, 2), 0)
    assert agree(counts(samples, X, reach), N * blocks(cells)) > 1e-4


@pytest.mark.parametrize(("motion", "u"), CASES.values(), ids=CASES)
def test_previous(motion, u):
    """log π = log ∫ p(x_t | u, x_{t−1}) dx_{t−1} = 0, and `sample_previous` draws from p / π."""
    u = np.array(u)
    reach = motion.decompose(u).sd_trans * 6.0 + np.hypot(u[0], u[1])
    cells = integral(lambda x: motion.log_density(X, u, x), X, reach)
    assert cells.sum() == pytest.approx(np.exp(motion.log_pi(X, u)[0]), abs=1e-3)
    samples = motion.sample_previous(np.repeat(X, N, axis=1), u, Draws(1, 3), 0)
    assert agree(counts(samples, X, reach), N * blocks(cells)) > 1e-4


def test_the_chi_square_above_notices_a_wrong_model():
    """A fifth more noise per driving is seen: the test has the power that it needs."""
    u = np.array(MOVES["in a curve"])
    reach = NOISY.decompose(u).sd_trans * 6.0 + 0.5
    cells = integral(lambda x: NOISY.log_density(x, u, X), X, reach)
    other = replace(NOISY, alpha2=0.24, alpha3=0.24)
    samples = other.sample(np.repeat(X, N, axis=1), u, Draws(1, 2), 0)
    assert agree(counts(samples, X, reach), N * blocks(cells)) < 1e-4


def test_defaults_integrate_to_one_in_the_plane():
    """On a grid in (x, y, θ), spacing a quarter of the smallest deviation, ± 6 of the largest."""
    motion, u = OdometryMotion(), np.array([0.5, 0.1, 0.3])
    d = motion.decompose(u)
    spread = 6.0 * (d.sd_trans + d.trans * d.sd_rot1), 6.0 * np.hypot(d.sd_rot1, d.sd_rot2)
    centre = compose(X[:, 0], u)
    xy, theta = (np.linspace(-s, s, 60) for s in spread)
    grid = np.stack([v.ravel() for v in np.meshgrid(xy, xy, theta)]) + centre[:, None]
    grid[2] = wrap(grid[2])
    volume = (xy[1] - xy[0]) ** 2 * (theta[1] - theta[0])
    assert np.exp(motion.log_density(grid, u, X)).sum() * volume == pytest.approx(1.0, abs=2e-3)


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


POSE = st.tuples(*3 * (st.floats(-5.0, 5.0, allow_subnormal=False),)).map(np.array)


@settings(deadline=None)  # the first call may compile
@given(POSE, POSE, POSE, st.sampled_from(list(MOVES.values())))
def test_the_density_does_not_depend_on_the_frame(frame, x, x_new, u):
    assume(np.hypot(*(x_new - x)[:2]) > 1e-3)  # nearer, the bearing is rounding
    u = np.array(u)
    here = NOISY.log_density(x_new[:, None], u, x[:, None])
    there = NOISY.log_density(compose(frame, x_new)[:, None], u, compose(frame, x)[:, None])
    # Coordinates of 20 m round by 4e-15 m: 4e-12 rad in the bearing at 1 mm, over σ² = 0.02 and
    # times an error of up to π, and as much for δ_trans.
    assert there == pytest.approx(here, abs=1e-8)


@settings(deadline=None)
@given(POSE, st.sampled_from(list(MOVES.values())))
def test_samples_do_not_depend_on_the_frame(frame, u):
    u, still = np.array(u), np.zeros((3, 20))
    moved = np.repeat(frame[:, None], 20, axis=1)
    here = NOISY.sample(still, u, Draws(3), 0)
    there = NOISY.sample(moved, u, Draws(3), 0)
    error = between(compose(frame, here.T), there.T)
    assert np.abs(error).max() < 1e-9


def test_a_move_undone_is_the_move():
    """The same numbers: sample(sample_previous(x)) leads back to x."""
    u, draws = np.array([0.3, 0.1, 0.4]), Draws(6, 2)
    x = np.random.default_rng(0).uniform(-3.0, 3.0, (3, 500))
    back = NOISY.sample(NOISY.sample_previous(x, u, draws, 9), u, draws, 9)
    assert back == pytest.approx(x)


@pytest.mark.parametrize("name", ["sample", "sample_previous"])
def test_headings_stay_in_the_half_open_circle(name):
    x = np.zeros((3, 2000))
    x[2] = np.linspace(-np.pi, np.pi, 2002)[1:-1]
    moved = getattr(NOISY, name)(x, np.array([0.0, 0.0, 3.0]), Draws(1), 0)
    assert moved[2].min() > -np.pi
    assert moved[2].max() <= np.pi
