"""Mean and covariance of each hypothesis against plain NumPy in extended precision, over the
particles of its cluster.
"""

import numpy as np
import pytest

from mcloc.estimate import cluster, hypotheses
from mcloc.particles import Particles
from mcloc.statespace import LINE, SE2, StateSpace

EPS = 2.0**-53
EXTENDED = np.longdouble
PI = EXTENDED("3.14159265358979323846264")


def space_of(*circular):
    n = len(circular)
    return StateSpace(tuple("abcdef"[:n]), ("m",) * n, circular)


TORUS = space_of(True, True)
ARM = space_of(False, False, True, True, False, True)
SPACES = {"line": LINE, "ring": space_of(True), "torus": TORUS, "plane": SE2, "arm": ARM}
MIDDLES = [np.pi, 0.1, -1.7]  # of the angles: one across the seam
WIDE = 0.4  # from the middle of a cloud to its edge, m or rad


def wrapped(angle):
    return angle - 2.0 * PI * np.rint(angle / (2.0 * PI))


def three_clouds(space, n, far=0.0):
    """Particles, even in three boxes, or balls, far from each other."""
    rng = np.random.default_rng(space.dimension)
    circular = np.array(space.circular)
    middles = far + 9.0 * np.arange(3.0) * rng.choice([-1.0, 1.0], (space.dimension, 1))
    middles[circular] = MIDDLES
    off = rng.normal(size=(space.dimension, n))
    radius = WIDE * rng.random(n) ** (1.0 / space.dimension)
    states = middles[:, rng.integers(0, 3, n)] + radius * off / np.sqrt((off**2).sum(axis=0))
    states[circular] = -np.arctan2(-np.sin(states[circular]), np.cos(states[circular]))
    return Particles.normalized(states, 0.3 * rng.normal(size=n))


def plain(states, weights, circular):
    """Mean (D,) and covariance (D, D) of some particles; and (D,) the mean of how far they are off
    that, which is 0 but for angles: their mean is that of their sines.
    """
    x, w = states.astype(EXTENDED), weights.astype(EXTENDED) / weights.astype(EXTENDED).sum()
    mean = x @ w
    for a in np.flatnonzero(circular):
        mean[a] = np.arctan2(np.sin(x[a]) @ w, np.cos(x[a]) @ w)
    off = x - mean[:, None]
    off[circular] = wrapped(off[circular])
    return mean, (off * w) @ off.T, np.abs(off @ w)


@pytest.mark.parametrize(
    ("name", "far"),
    [*((name, 0.0) for name in SPACES), ("line", 1e5), ("line", 1e7), ("plane", 1e5)],
)
def test_moments_are_those_of_the_particles(name, far):
    """However far from the origin: what is lost of the mean there, a few roundings of it, is lost
    of the covariance squared, or times how far the mean of an angle is off that of the differences.
    """
    n, space = 6000, SPACES[name]
    circular = np.array(space.circular)
    particles = three_clouds(space, n, far)
    found, labels = hypotheses(particles, space), cluster(particles, space)
    by_share = sorted(set(labels), key=lambda k: -particles.weights[labels == k].sum())
    assert len(found) >= 3
    for h, k in zip(found, by_share, strict=False):
        inside = labels == k
        mean, spread, between = plain(
            particles.states[:, inside], particles.weights[inside], circular
        )
        assert h.share == pytest.approx(particles.weights[inside].sum())
        lost = 2.0 * n * EPS * (WIDE + 1.0) + np.where(circular, 0.0, 64.0 * EPS * (far + 40.0))
        off = h.mean - mean
        off[circular] = wrapped(off[circular])
        assert (np.abs(off) <= lost).all()
        rounding = 2.0 * n * EPS * (WIDE + 1.0) ** 2 + np.outer(lost, lost)
        rounding += np.outer(lost, between) + np.outer(between, lost)
        assert (np.abs(h.covariance - spread) <= rounding).all()
        assert h.covariance == pytest.approx(h.covariance.T, rel=0.0, abs=rounding.max())
        assert (spread.diagonal() > 1e-3).all()
        assert (h.mean[circular] > -np.pi).all()
        assert (h.mean[circular] <= np.pi).all()


@pytest.mark.parametrize("heading", [np.pi, -np.pi + 1e-12, np.pi - 0.1, 0.0, np.pi / 12.0])
def test_two_headings_on_both_sides_of_the_seam(heading):
    """In one bin or in two: mean and variance by hand."""
    headings = -np.mod(-(heading + np.array([-0.04, 0.06])) + np.pi, 2.0 * np.pi) + np.pi
    (h,) = hypotheses(Particles.equal(np.stack([[2.1, 2.2], [5.1, 5.1], headings])), SE2)
    assert h.mean[:2] == pytest.approx([2.15, 5.1])
    assert np.exp(1j * h.mean[2]) == pytest.approx(np.exp(1j * (heading + 0.01)))
    expected = [[0.0025, 0.0, 0.0025], [0.0, 0.0, 0.0], [0.0025, 0.0, 0.0025]]
    assert h.covariance == pytest.approx(np.array(expected), abs=1e-14)


@pytest.mark.parametrize("name", SPACES)
@pytest.mark.parametrize("share", [0.3, 0.5])
def test_one_particle_spreads_no_more_than_its_place_is_rounded(name, share):
    """Its mean w x / w is x but for 2 roundings; that of an angle by its sines but for some 4."""
    space = SPACES[name]
    rng = np.random.default_rng(7)
    states = rng.uniform(-3.0, 3.0, (space.dimension, 2))
    states[0] = [-1.2, 1.7]
    particles = Particles.normalized(states, np.log([share, 1.0 - share]))
    found = hypotheses(particles, space)
    assert len(found) == 2
    for h in found:
        place = states[:, np.abs(states[0] - h.mean[0]).argmin()]
        lost = 4.0 * np.spacing(np.maximum(np.abs(place), 1.0))
        assert (np.abs(h.mean - place) <= lost).all()
        assert (np.abs(h.covariance) <= np.outer(lost, lost)).all()


def test_hills_of_little_weight_count_in_no_hypothesis():
    """Nor do they move the others."""
    rng = np.random.default_rng(8)
    clouds = three_clouds(SE2, 3000)
    strays = rng.uniform(50.0, [[90.0], [90.0], [53.0]], (3, 40))
    more = Particles.normalized(
        np.concatenate([clouds.states, strays], axis=1),
        np.append(clouds.log_weights, np.full(40, np.log(1e-4))),
    )
    alone, among = hypotheses(clouds, SE2), hypotheses(more, SE2)
    assert len(alone) == len(among)
    for a, b in zip(alone, among, strict=True):
        assert b.mean == pytest.approx(a.mean, abs=1e-12)
        assert b.covariance == pytest.approx(a.covariance, abs=1e-12)
        assert b.share == pytest.approx(a.share / 1.004)
