"""Nodes take any parts: here some of their particles are drawn from the measurement."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.stats import binom
from tests.filters.hierarchical.worlds import forward, grey, hierarchy, histogram, transition

from mcloc.draws import Draws, Stream
from mcloc.filters.hierarchical.region import ROOT
from mcloc.filters.hierarchical.techniques import Techniques
from mcloc.filters.particle_filter import Part
from mcloc.filters.recovery import RandomParticles
from mcloc.proposals.dual import Dual
from mcloc.proposals.forward import Forward
from mcloc.proposals.predictive import Pairs
from mcloc.resampling import Systematic
from mcloc.sample_size import Fixed
from mcloc.sensors.grey_tile import GreyTile, PreciseGreyTile

NONE_RANDOM = Techniques(virtual=0, random=0.0)


class Found:
    """Tiles of a row by chances (tiles,)."""

    log_pi = 0.0

    def __init__(self, chances):
        self.chances = chances

    def sample(self, draws, first, n):
        u = draws.uniform(Stream.PROPOSAL, first, n)[0]
        found = np.searchsorted(np.cumsum(self.chances), u)
        return np.minimum(found, len(self.chances) - 1)[None].astype(float)

    def log_density(self, x):
        with np.errstate(divide="ignore"):
            return np.log(self.chances)[x[0].astype(int)]


@dataclass(frozen=True)
class FromGrey:
    """q̄ ∝ p(z | x) + least."""

    sensor: GreyTile
    least: float = 0.0

    def given(self, z, draws):
        p = np.exp(self.sensor.log_likelihood(np.arange(float(self.sensor.shape[0]))[None], z))
        return Found((p + self.least) / (p + self.least).sum())


def mixed(sensor, phi, group=1):
    """n -> 1 − φ of n particles as MCL draws them, and φ from the measurement."""

    def parts(n):
        dual = round(phi * n)
        return (
            Part(1.0 - phi, Forward(Systematic()), Fixed(n - dual)),
            Part(phi, Dual(FromGrey(sensor, 1e-3), Pairs()), Fixed(dual), group),
        )

    return parts


TILES, MOVES, SEEN = 11, (1, 1, -1, 0), (3, 6, 2, 4)


def exact():
    bel = np.full(TILES, 1.0 / TILES)
    for u, z in zip(MOVES, SEEN, strict=True):
        joint = bel @ transition(u, TILES) * grey(z, TILES)
        bel = joint / joint.sum()
    return bel


@pytest.mark.parametrize("group", [0, 1])
def test_the_root_has_the_belief_of_bayes(falls_as_root_n, group):
    """Both parts cover the target, in one group or in two."""
    sensor, sizes, results = GreyTile((TILES,)), (64, 512, 4096), []
    for n in sizes:
        tiles = hierarchy(sensor, 1, n, techniques=NONE_RANDOM, parts=mixed(sensor, 0.3, group))
        errors = np.empty(120)
        for seed in range(len(errors)):
            bel = tiles.start(tiles.environment, Draws(seed))
            for step, (u, z) in enumerate(zip(MOVES, SEEN, strict=True), 1):
                bel, info = tiles.step(bel, np.array([u]), np.array([z]), Draws(seed, step))
                assert info.weighed == n
            found = histogram(bel.nodes[ROOT].particles, TILES)
            errors[seed] = np.sum((found - exact()) ** 2)
        results.append(errors)
    falls_as_root_n(sizes, results)


SEEDS, TRACKED, LATER = 16, 15, 3


def found_again(parts):
    """In how many runs a robot is found that was carried from tile 20 to 100 unnoticed, so many
    steps later. α = 0.1 in the dynamics.
    """
    sensor = PreciseGreyTile((128,), error=1)
    tiles = hierarchy(
        sensor,
        7,
        40,
        techniques=NONE_RANDOM,
        parts=parts(sensor),
        recovery=RandomParticles(share=0.1, doubt_below=0.0),
    )
    found = 0
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        bel = tiles.start(tiles.environment, Draws(seed))
        for step in range(1, TRACKED + LATER + 1):
            z = sensor.sample(np.array([20.0 if step <= TRACKED else 100.0]), rng)
            bel, info = tiles.step(bel, np.array([0]), z, Draws(seed, step))
            assert {len(node.particles) for node in bel.nodes.values()} == {40}
            assert info.weighed == 40 * len(bel.path)
        found += abs(histogram(bel.particles, 130).argmax() - 100) <= 2
    return found


def test_a_robot_that_was_carried_off_is_found_where_the_measurement_says():
    """Always; by random particles alone at most when one of the root's 4 a step comes upon one of 3
    tiles of 128.
    """
    assert found_again(lambda sensor: mixed(sensor, 0.2)) == SEEDS
    by_chance = LATER * 4 * 3 / 128
    assert found_again(lambda sensor: forward(0.0)) <= binom.ppf(1 - 1e-4, SEEDS, by_chance) < SEEDS
