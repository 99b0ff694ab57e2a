"""Particles that only say in which half they are: chances of zones against enumeration of tiles,
and filters of zones against Bayes' rule over two of them.
"""

from functools import cache

import numpy as np
import pytest
from tests.filters.hierarchical.worlds import grey, hierarchy, rows, transition

from mcloc.draws import Draws
from mcloc.filters.hierarchical.region import ROOT, depth_of, region_of
from mcloc.filters.hierarchical.techniques import Techniques
from mcloc.filters.hierarchical.zones import ZONE, ZoneOnly
from mcloc.motion.tiles import TileMotion
from mcloc.sensors.grey_tile import GreyTile

POINTS = 6000  # in each zone; 6 and 5 tiles divide it, and 3 and so on
TILES = 11
DOMAIN, MOTION, SENSOR = rows(TILES), TileMotion((TILES,)), GreyTile((TILES,))
KEYS = (1, 2, 3, 5, 6)  # whose regions have 11, 6, 5, 3 and 3 tiles
BOTH = np.array([[0.0, 1.0]])
every_action = pytest.mark.parametrize("action", [-1, 0, 1])
every_key = pytest.mark.parametrize("key", KEYS)


def zones_of(key, points=POINTS, domain=DOMAIN, motion=MOTION, sensor=SENSOR):
    """Motion, sensor and environment of a node."""
    region, axis = region_of(domain.whole, key), depth_of(key) % domain.whole.space.dimension
    return ZoneOnly(domain, points).models(region, axis, motion, sensor)


def halves_of(key):
    """The tiles of each half of a node's region, by its borders."""
    low, high = -0.5, TILES - 0.5
    for digit in f"{key:b}"[1:]:
        middle = (low + high) / 2.0
        low, high = (middle, high) if digit == "1" else (low, middle)
    x, middle = np.arange(TILES), (low + high) / 2.0
    return x[(low < x) & (x <= middle)], x[(middle < x) & (x <= high)]


def enumerated(key, action):
    """(2, 2): p(zone′ | zone, u), all tiles of a zone being as likely, of moves that stay."""
    p, halves = transition(action, TILES), halves_of(key)
    counts = np.array([[p[np.ix_(a, b)].sum() / len(a) for b in halves] for a in halves])
    return counts / counts.sum(axis=1, keepdims=True)


def chances(motion, u):
    """(2, 2): by its densities."""
    pairs = [[np.array([[a], [b]]).astype(float) for b in (0, 1)] for a in (0, 1)]
    return np.array(
        [[np.exp(motion.log_density(b[None], u, a[None])[0]) for a, b in row] for row in pairs]
    )


@every_key
@every_action
def test_chances_of_zones_are_those_of_their_tiles(key, action):
    """From 6000 moves of each zone, those that stay: within 4.5 deviations of a share of them."""
    motion, _, _ = zones_of(key)
    found, expected = chances(motion, np.array([action])), enumerated(key, action)
    assert found.sum(axis=1) == pytest.approx(1.0)
    deviation = np.sqrt(expected * (1.0 - expected) / (0.5 * POINTS))
    assert (np.abs(found - expected) <= 4.5 * deviation).all()


@every_key
def test_likelihoods_of_zones_are_averages_over_their_tiles(key):
    """Exactly: the points are spread over the tiles evenly."""
    _, sensor, _ = zones_of(key)
    for z in range(TILES):
        expected = [np.mean(grey(z, TILES)[half]) for half in halves_of(key)]
        assert np.exp(sensor.log_likelihood(BOTH, np.array([z]))) == pytest.approx(expected)
        explained = [
            SENSOR.explained(half[None] * 1.0, np.array([z])).mean() for half in halves_of(key)
        ]
        assert sensor.explained(BOTH, np.array([z])) == pytest.approx(explained)
    assert sensor.readings(np.array([3])) == sensor.beams(np.array([3])) == 1
    assert sensor.source(np.array([3])) == "grey"


class Sometimes:
    """p(x | m) of tiles, 0 on some, and U(x) in proportion to it."""

    def __init__(self, prior):
        self.prior = prior

    def log_prior(self, x):
        with np.errstate(divide="ignore"):
            return np.log(self.prior)[x[0].astype(int)]

    def log_density(self, x):
        return self.log_prior(x) - np.log(self.prior.sum())


def test_where_a_robot_hardly_can_be_counts_for_little():
    """Averages and moves by p(x | m); a zone is the likelier the more of it is free."""
    prior = np.array([1.0, 0.2, 0.5, 1.0, 0.0, 0.3, 1.0, 1.0, 0.1, 0.0, 1.0])
    domain = type(DOMAIN)(DOMAIN.whole, Sometimes(prior))
    motion, sensor, zones = zones_of(ROOT, domain=domain)
    halves, p = halves_of(ROOT), transition(1, TILES)
    for z in range(TILES):
        expected = [grey(z, TILES)[half] @ prior[half] / prior[half].sum() for half in halves]
        assert np.exp(sensor.log_likelihood(BOTH, np.array([z]))) == pytest.approx(expected)
    counts = np.array([[prior[a] @ p[np.ix_(a, b)] @ prior[b] for b in halves] for a in halves])
    expected = counts / counts.sum(axis=1, keepdims=True)
    found = chances(motion, np.array([1]))
    assert found == pytest.approx(expected, abs=4.5 * 0.5 / np.sqrt(0.3 * POINTS))
    free = np.array([prior[half].sum() for half in halves])
    assert np.exp(zones.log_density(BOTH)) == pytest.approx(free / free.sum())
    drawn = zones.sample(Draws(1), 0, 20_000)[0]
    share = free[1] / free.sum()
    assert drawn.mean() == pytest.approx(share, abs=4.5 * np.sqrt(share * (1 - share) / 20_000))
    assert (zones.log_prior(BOTH) == 0.0).all()


@every_action
def test_samples_have_these_chances_and_so_have_those_before(action):
    motion, _, _ = zones_of(2, points=600)
    u, n = np.array([action]), 20_000
    p = chances(motion, u)
    for zone in (0, 1):
        x = np.full((1, n), float(zone))
        share = motion.sample(x, u, Draws(3), 0)[0].mean()
        assert share == pytest.approx(p[zone, 1], abs=4.5 * 0.5 / np.sqrt(n))
        before = motion.sample_previous(x, u, Draws(4), 0)[0].mean()
        expected = p[1, zone] / p[:, zone].sum()
        assert before == pytest.approx(expected, abs=4.5 * 0.5 / np.sqrt(n))
        assert np.exp(motion.log_pi(x[:, :1], u)) == pytest.approx(p[:, zone].sum())
    assert chances(motion.doubted(), u) == pytest.approx(p)  # tiles know no doubt


def test_a_zone_keeps_what_no_move_leaves_in_the_region():
    """A leap of 5 tiles from each of 6, or of 3."""

    class Leap:
        def sample(self, x, u, draws, first):
            return (x + 5.0) % TILES

    motion, _, _ = zones_of(2, motion=Leap())  # from tile 0 to 5, all others lead out
    assert chances(motion, None).tolist() == [[0.0, 1.0], [0.0, 1.0]]
    motion, _, _ = zones_of(5, motion=Leap())
    assert chances(motion, None).tolist() == [[1.0, 0.0], [0.0, 1.0]]


MOVES, SEEN = (1, 1, -1, 0), (3, 6, 2, 4)


@cache
def two_states(share):
    """(2,): Bel of the zones of the root by Bayes' rule, with U(zone) as the zones have it."""
    motion, _, _ = zones_of(ROOT, points=600)
    bel = np.array([6.0, 5.0]) / 11.0
    for u, z in zip(MOVES, SEEN, strict=True):
        seen = np.array([grey(z, TILES)[half].mean() for half in halves_of(ROOT)])
        moved = bel @ chances(motion, np.array([u]))
        joint = ((1.0 - share) * moved + share * np.array([6.0, 5.0]) / 11.0) * seen
        bel = joint / joint.sum()
    return bel


@pytest.mark.parametrize("share", [0.0, 0.1])
def test_the_root_has_the_belief_of_two_states(falls_as_root_n, share):
    sizes, results = (64, 512, 4096), []
    for n in sizes:
        tiles = hierarchy(SENSOR, 1, n, zones=600, techniques=Techniques(virtual=0, random=share))
        errors = np.empty(120)
        for seed in range(len(errors)):
            bel = tiles.start(tiles.environment, Draws(seed))
            for step, (u, z) in enumerate(zip(MOVES, SEEN, strict=True), 1):
                bel, _ = tiles.step(bel, np.array([u]), np.array([z]), Draws(seed, step))
            answer = tiles.query(bel, depth=1)
            half = int(answer.region.low[0] > 0.0)
            errors[seed] = (answer.probability - two_states(share)[half]) ** 2
            assert answer.outside == 0.0
        results.append(errors)
    falls_as_root_n(sizes, results)


def test_particles_and_the_states_that_stand_for_them():
    zones = ZoneOnly(DOMAIN, 60)
    assert zones.space is ZONE
    region = region_of(DOMAIN.whole, 3)  # tiles 6 … 10, halved at 7.75
    x = np.array([[0.0, 6.0, 7.0, 8.0, 10.0]])
    particles = zones.described(region, 0, x)
    assert particles.tolist() == [[0.0, 0.0, 0.0, 1.0, 1.0]]
    assert zones.half(region, 0, particles).tolist() == [0, 0, 0, 1, 1]
    many = np.repeat(BOTH, 60, axis=1)
    states = zones.states(region, 0, many)[0]
    assert sorted(set(states[many[0] == 0.0])) == [6.0, 7.0]
    assert sorted(set(states[many[0] == 1.0])) == [8.0, 9.0, 10.0]
    assert np.unique(states[:60], return_counts=True)[1].tolist() == [30, 30]
    assert zones.near(region, particles).all()
    assert zones.collected(region, particles) is particles


@pytest.mark.parametrize("shape", [(11,), (5, 3)])
def test_halves_without_a_tile_do_no_harm(shape):
    """Deeper than there are tiles to tell apart: every step has a belief, and answers."""
    sensor = GreyTile(shape)
    tiles = hierarchy(sensor, 7, 30, zones=30)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        bel = tiles.start(tiles.environment, Draws(seed))
        for step in range(1, 20):
            z = rng.integers(0, shape)
            u = rng.integers(-1, 2, len(shape))
            bel, _ = tiles.step(bel, u, z, Draws(seed, step))
            assert len(bel.path) == 7
            answer = tiles.query(bel)
            assert 0.0 < answer.probability <= 1.0
            assert np.isfinite(bel.particles.log_weights[bel.particles.weights > 0.0]).all()
