"""All motion models: a density that integrates to 1, samplers that agree with it, π = 1.

Integrals are taken in polar coordinates (r, a, θ) by Gauss's rule with 6 nodes a block, whose error
is far below that of the samples while blocks are not much wider than 4 deviations.
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
from mcloc.motion import OdometryMotion, OmnidirectionalMotion, VelocityMotion
from mcloc.registry import parameters
from mcloc.statespace import LogWeights, States

LEAST = {"sigma_rot_min": 0.15, "sigma_trans_min": 0.08}
NOISY = {
    "odometry": OdometryMotion(alpha1=0.2, alpha2=0.2, alpha3=0.2, alpha4=0.1, **LEAST),
    "omnidirectional": OmnidirectionalMotion(
        alpha1=0.2, alpha2=0.2, alpha3=0.2, alpha4=0.1, alpha5=0.4, **LEAST
    ),
    "velocity": VelocityMotion(
        alpha1=0.2,
        alpha2=0.1,
        alpha3=0.2,
        alpha4=0.2,
        alpha5=0.1,
        alpha6=0.1,
        sigma_rot_min=0.3,  # a chord's direction errs by half of what the arc's turn does
        sigma_trans_min=0.08,
    ),
}
VARIANTS = {
    "sometimes reversed": lambda motion: replace(motion, p_reverse=0.3),
    "doubted": lambda motion: replace(motion, loose=2.0).doubted(),
}
MOVES = {
    "ahead": (0.6, 0.0, 0.0),
    "in a curve": (0.4, 0.3, 0.9),
    "backwards": (-0.5, 0.1, -0.3),
    "sideways": (0.05, 0.4, 0.1),
    "pure rotation": (0.0, 0.0, 1.2),
    "half a turn": (0.02, 0.01, np.pi),
    "at rest": (0.0, 0.0, 0.0),
}
X = np.array([[3.0], [-2.0], [2.8]])
BLOCKS = (5, 12, 8)  # of a χ² test
NODES = 6  # of an integral over a block, along each axis
N = 20_000


def reach(motion, u) -> float:
    """How far moves go: 6 deviations and more."""
    numbers = motion.noise(np.array(u))[1]
    furthest = {
        OdometryMotion: lambda rot1, trans, rot2, a, sd, b: abs(trans) + 6.0 * sd,
        OmnidirectionalMotion: lambda way, trans, rot, sd, across, b: trans + 6.0 * max(sd, across),
        VelocityMotion: lambda length, turn, last, sd, a, b: abs(length) + 6.0 * sd,
    }
    return furthest[type(motion)](*numbers)


def axis(blocks: int, span: float):
    """Nodes and weights over [0, span], block by block."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    nodes = (np.arange(blocks)[:, None] + 0.5 + 0.5 * x) * span / blocks
    return nodes.ravel(), np.tile(0.5 * w * span / blocks, blocks)


def integral(log_density: Callable[[States], LogWeights], at: States, reach: float):
    """Blocks of ∫ p r dr da dθ over the places at distance r < reach in direction a from `at`."""
    axes = [axis(n, s) for n, s in zip(BLOCKS, (reach, 2.0 * np.pi, 2.0 * np.pi), strict=True)]
    r, a, theta = (v.ravel() for v in np.meshgrid(*(nodes for nodes, _ in axes), indexing="ij"))
    places = np.stack([at[0] + r * np.cos(a), at[1] + r * np.sin(a), wrap(theta)])
    volume = np.einsum("i,j,k->ijk", *(weights for _, weights in axes)).ravel()
    cells = np.exp(log_density(places)) * r * volume
    i, j, k = BLOCKS
    return cells.reshape(i, NODES, j, NODES, k, NODES).sum(axis=(1, 3, 5))


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


CASES = {
    f"{model}, {move}": (motion, u) for model, motion in NOISY.items() for move, u in MOVES.items()
} | {
    f"{model}, in a curve, {name}": (variant(motion), MOVES["in a curve"])
    for model, motion in NOISY.items()
    for name, variant in VARIANTS.items()
}


@pytest.mark.parametrize(("motion", "u"), CASES.values(), ids=CASES)
def test_forwards(motion, u):
    """∫ p(x_t | u, x_{t−1}) dx_t = 1, and `sample` draws from it."""
    u, far = np.array(u), reach(motion, u)
    expected = integral(lambda x: motion.log_density(x, u, X), X, far)
    assert expected.sum() == pytest.approx(1.0, abs=5e-4)
    samples = motion.sample(np.repeat(X, N, axis=1), u, Draws(1, 2), 0)
    assert agree(counts(samples, X, far), N * expected) > 1e-4


@pytest.mark.parametrize(("motion", "u"), CASES.values(), ids=CASES)
def test_previous(motion, u):
    """log π = log ∫ p(x_t | u, x_{t−1}) dx_{t−1} = 0, and `sample_previous` draws from p / π."""
    u, far = np.array(u), reach(motion, u)
    expected = integral(lambda x: motion.log_density(X, u, x), X, far)
    assert expected.sum() == pytest.approx(np.exp(motion.log_pi(X, u)[0]), abs=5e-4)
    samples = motion.sample_previous(np.repeat(X, N, axis=1), u, Draws(1, 3), 0)
    assert agree(counts(samples, X, far), N * expected) > 1e-4


@pytest.mark.parametrize("motion", NOISY.values(), ids=NOISY)
def test_the_chi_square_above_notices_a_wrong_model(motion):
    """A fifth more noise is seen: the test has the power that it needs."""
    u = np.array(MOVES["in a curve"])
    far = reach(motion, u)
    expected = integral(lambda x: motion.log_density(x, u, X), X, far)
    louder = {f.name: 1.2 * getattr(motion, f.name) for f in parameters(motion)}
    other = replace(motion, **louder | {"p_reverse": 0.0, "loose": 5.0})
    samples = other.sample(np.repeat(X, N, axis=1), u, Draws(1, 2), 0)
    assert agree(counts(samples, X, far), N * expected) < 1e-4


@pytest.mark.parametrize("motion", [type(m)() for m in NOISY.values()], ids=NOISY)
def test_defaults_integrate_to_one_in_the_plane(motion):
    """On a grid in (x, y, θ), 48 points over ± 7 of the deviations."""
    u = np.array([0.5, 0.1, 0.3])
    samples = motion.sample(np.repeat(X, 4000, axis=1), u, Draws(1), 0)
    centre = compose(X[:, 0], u)
    spread = 2.0 * np.abs(between(centre, samples.T)).max(axis=0)  # 4000 reach 3.5 deviations
    axes = [np.linspace(-s, s, 48) for s in spread]
    offsets = np.stack([v.ravel() for v in np.meshgrid(*axes)], axis=1)
    grid = np.ascontiguousarray(compose(centre, offsets).T)
    volume = np.prod([axis[1] - axis[0] for axis in axes])
    assert np.exp(motion.log_density(grid, u, X)).sum() * volume == pytest.approx(1.0, abs=2e-3)


POSE = st.tuples(*3 * (st.floats(-5.0, 5.0, allow_subnormal=False),)).map(np.array)
MODEL = st.sampled_from(list(NOISY.values()))
MOVE = st.sampled_from(list(MOVES.values())).map(np.array)


@settings(deadline=None)  # the first call may compile
@given(MODEL, POSE, POSE, POSE, MOVE)
def test_the_density_does_not_depend_on_the_frame(motion, frame, x, x_new, u):
    assume(np.hypot(*(x_new - x)[:2]) > 1e-3)  # nearer, the bearing is rounding
    here = motion.log_density(x_new[:, None], u, x[:, None])
    there = motion.log_density(compose(frame, x_new)[:, None], u, compose(frame, x)[:, None])
    # Coordinates of 20 m round by 4e-15 m: 4e-12 rad in the bearing at 1 mm, over σ² = 0.02 and
    # times an error of up to π, and as much for the distance; an arc's length can be many times
    # its chord, and its logarithm is then as many times less sure.
    assert there == pytest.approx(here, abs=1e-8, rel=1e-9)


@settings(deadline=None)
@given(MODEL, POSE, MOVE)
def test_samples_do_not_depend_on_the_frame(motion, frame, u):
    still = np.zeros((3, 20))
    moved = np.repeat(frame[:, None], 20, axis=1)
    here = motion.sample(still, u, Draws(3), 0)
    there = motion.sample(moved, u, Draws(3), 0)
    error = between(compose(frame, here.T), there.T)
    assert np.abs(error).max() < 1e-9


@pytest.mark.parametrize("motion", NOISY.values(), ids=NOISY)
def test_a_move_undone_is_the_move(motion):
    """The same numbers: sample(sample_previous(x)) leads back to x."""
    u, draws = np.array([0.3, 0.1, 0.4]), Draws(6, 2)
    x = np.random.default_rng(0).uniform(-3.0, 3.0, (3, 500))
    back = motion.sample(motion.sample_previous(x, u, draws, 9), u, draws, 9)
    assert back == pytest.approx(x)


@pytest.mark.parametrize("motion", NOISY.values(), ids=NOISY)
@pytest.mark.parametrize("name", ["sample", "sample_previous"])
def test_headings_stay_in_the_half_open_circle(motion, name):
    x = np.zeros((3, 2000))
    x[2] = np.linspace(-np.pi, np.pi, 2002)[1:-1]
    moved = getattr(motion, name)(x, np.array([0.0, 0.0, 3.0]), Draws(1), 0)
    assert moved[2].min() > -np.pi
    assert moved[2].max() <= np.pi


@pytest.mark.parametrize("motion", NOISY.values(), ids=NOISY)
def test_doubt_loosens_every_deviation_and_reverses_as_often_as_not(motion):
    doubted = replace(motion, loose=60.0).doubted()
    assert doubted.p_reverse == 0.5
    for field in parameters(motion):
        if field.name not in ("p_reverse", "loose"):
            # 60 times 0.15 and less, but never more than a deviation may be.
            assert getattr(doubted, field.name) == min(60.0 * getattr(motion, field.name), 10.0)
