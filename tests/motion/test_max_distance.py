"""Anywhere within reach: the density over discs, samples against it, and the walk of many steps."""

import numpy as np
import pytest
from scipy.stats import chisquare, kstest

from mcloc.draws import Draws
from mcloc.errors import ConfigError
from mcloc.geometry import wrap
from mcloc.motion.max_distance import MaxDistanceMotion

MOTION = MaxDistanceMotion(speed=0.4, turn_rate=0.8)
POSE = np.array([[3.0], [-2.0], [2.9]])
PLACE = POSE[:2]
CASES = {"a place": (PLACE, 0.5), "a pose": (POSE, 0.5), "a pose that turned around": (POSE, 6.0)}
every_case = pytest.mark.parametrize(("x", "u"), CASES.values(), ids=CASES)
N = 20_000
RINGS, SECTORS, TURNS = 4, 8, 4  # of a χ² test


def around(x, far, turn):
    """(D, n): midpoints in polar cells over twice the disc and its headings, and (n,) their sizes.

    Edges of cells lie on the edges of what is within reach.
    """
    m = 16
    r, direction = (np.arange(2 * m) + 0.5) * far / m, (np.arange(m) + 0.5) * 2.0 * np.pi / m
    reaching = int(np.pi / turn * m)  # cells to each side, all different headings
    off = (np.arange(-reaching, reaching) + 0.5) * turn / m if len(x) == 3 else np.zeros(1)
    r, direction, off = (v.ravel() for v in np.meshgrid(r, direction, off))
    places = [x[0] + r * np.cos(direction), x[1] + r * np.sin(direction)]
    of_heading = [wrap(x[2] + off)] if len(x) == 3 else []
    size = r * far / m * 2.0 * np.pi / m * (turn / m if len(x) == 3 else 1.0)
    return np.array(places + of_heading), size


def shares(x, samples, far, turn):
    """(3 or 2, n): what is uniform over (0, 1) if samples are uniform within reach of x."""
    dx, dy = samples[:2] - x[:2]
    found = [(dx**2 + dy**2) / far**2, np.arctan2(dy, dx) / (2.0 * np.pi) + 0.5]
    if len(x) == 3:
        found.append(0.5 + wrap(samples[2] - x[2]) / (2.0 * turn))
    return np.array(found)


@every_case
def test_the_density_integrates_to_1(x, u):
    places, size = around(x, 0.4 * u, min(np.pi, 0.8 * u))
    assert size @ np.exp(MOTION.log_density(places, u, x)) == pytest.approx(1.0)


@every_case
def test_pi_is_1(x, u):
    """∫ p(x_new | u, x_{t−1}) dx_{t−1}."""
    places, size = around(x, 0.4 * u, min(np.pi, 0.8 * u))
    assert size @ np.exp(MOTION.log_density(x, u, places)) == pytest.approx(1.0)
    assert (MOTION.log_pi(places, u) == 0.0).all()


@every_case
@pytest.mark.parametrize("way", ["sample", "sample_previous"])
def test_samples_have_this_density(x, u, way):
    """Each coordinate by Kolmogorov–Smirnov, and all together by χ²."""
    samples = getattr(MOTION, way)(np.repeat(x, N, axis=1), u, Draws(4, 1), 0)
    found = shares(x, samples, 0.4 * u, min(np.pi, 0.8 * u))
    for share in found:
        assert kstest(share, "uniform").pvalue > 1e-4
    blocks = (RINGS, SECTORS, TURNS)[: len(x)]
    counts = np.histogramdd(found.T, blocks, [(0.0, 1.0)] * len(x))[0]
    assert counts.sum() == N
    assert chisquare(counts.ravel()).pvalue > 1e-4


@pytest.mark.parametrize("origin", [0.0, 1e6])
def test_what_was_drawn_can_be(origin):
    """Also at the edge of the disc where places are rounded: the density is that of the disc."""
    x = np.array([[origin], [-origin], [-3.1]]) + np.zeros(N)
    samples = MOTION.sample(x, 0.1, Draws(5), 0)
    edge, direction = x.copy(), np.linspace(0.0, 2.0 * np.pi, N)
    edge += 0.04 * np.array([np.cos(direction), np.sin(direction), np.zeros(N)])
    edge[2] = wrap(-3.1 - 0.08)
    for x_new in (samples, edge):
        expected = -np.log(np.pi * 0.04**2 * 2.0 * 0.08)
        assert MOTION.log_density(x_new, 0.1, x) == pytest.approx(expected)
        assert MOTION.log_density(x, 0.1, x_new) == pytest.approx(expected)
    assert (samples[2] > -np.pi).all()
    assert (samples[2] <= np.pi).all()


def test_two_steps_overlap_as_two_discs():
    """The distance walked in two steps has density 2 π s · lens(s) / (π r²)², lens(s) the area that
    two discs of radius r share at distance s.
    """
    r = 0.4 * 0.5
    s = np.linspace(0.0, 2.0 * r, 2001)
    half = np.clip(s / (2.0 * r), 0.0, 1.0)
    lens = 2.0 * r**2 * np.arccos(half) - 0.5 * s * np.sqrt(np.maximum(4.0 * r**2 - s**2, 0.0))
    density = 2.0 * np.pi * s * lens / (np.pi * r**2) ** 2
    below = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(s))])
    assert below[-1] == pytest.approx(1.0, abs=1e-5)
    x = np.repeat(PLACE, N, axis=1)
    for step in (1, 2):
        x = MOTION.sample(x, 0.5, Draws(6, step), 0)
    walked = np.hypot(*(x - PLACE))
    assert kstest(walked, lambda v: np.interp(v, s, below)).pvalue > 1e-4


def test_places_move_as_poses_do():
    assert np.array_equal(
        MOTION.sample(POSE, 0.5, Draws(1), 0)[:2], MOTION.sample(PLACE, 0.5, Draws(1), 0)
    )


def test_out_of_reach_is_impossible():
    x_new = POSE + np.array([[0.21, 0.0, 0.0, 0.19], [0.0, 0.0, 0.0, 0.0], [0.0, 0.41, -0.41, 0.0]])
    log_p = MOTION.log_density(x_new, 0.5, POSE)
    assert np.isneginf(log_p).tolist() == [True, True, True, False]


def test_no_time_no_move():
    x = np.repeat(POSE, 9, axis=1)
    for way in (MOTION.sample, MOTION.sample_previous):
        moved = way(x, 0.0, Draws(1), 0)
        assert (moved[:2] == x[:2]).all()
        assert moved[2] == pytest.approx(x[2], abs=1e-15)
    with pytest.raises(ConfigError, match="no density"):
        MOTION.log_density(x, 0.0, x)


@pytest.mark.parametrize("u", [-0.1, np.nan, np.inf])
def test_a_time_that_cannot_be_is_refused(u):
    for way in (MOTION.sample, MOTION.sample_previous):
        with pytest.raises(ConfigError, match="seconds"):
            way(POSE, u, Draws(1), 0)
    with pytest.raises(ConfigError, match="seconds"):
        MOTION.log_density(POSE, u, POSE)


@pytest.mark.parametrize("way", ["sample", "sample_previous"])
@pytest.mark.parametrize("axes", [2, 3])
def test_chunks_do_not_matter(way, axes):
    move = getattr(MOTION, way)
    x = np.random.default_rng(1).uniform(-3.0, 3.0, (axes, 200))
    before = x.copy()
    whole = move(x, 0.5, Draws(3, 2, 1), 40)
    parts = [move(x[:, a:b], 0.5, Draws(3, 2, 1), 40 + a) for a, b in ((0, 1), (1, 78), (78, 200))]
    assert np.array_equal(whole, np.concatenate(parts, axis=1))
    assert np.array_equal(x, before)
    assert not np.array_equal(whole, move(x, 0.5, Draws(3, 3, 1), 40))


def test_there_is_nothing_to_doubt():
    assert MOTION.doubted() is MOTION


@pytest.mark.parametrize("wrong", [{"speed": 0.0}, {"turn_rate": -1.0}, {"speed": np.nan}])
def test_what_cannot_be_is_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        MaxDistanceMotion(**wrong)
