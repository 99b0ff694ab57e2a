"""Answers of a hierarchy: regions along its path, how probable they are, and what a step that was
interrupted answers.
"""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from tests.filters.hierarchical.worlds import hierarchy, led, same

from mcloc.draws import Draws
from mcloc.errors import ConfigError
from mcloc.filters.hierarchical.belief import HierarchicalBelief
from mcloc.filters.hierarchical.techniques import Techniques
from mcloc.particles import Particles
from mcloc.sensors.grey_tile import PreciseGreyTile

ROW, FLOOR = (128,), (16, 8)
LEVELS = 7
WORLDS = {
    "row": hierarchy(PreciseGreyTile(ROW, error=5), LEVELS),
    "floor": hierarchy(PreciseGreyTile(FLOOR, error=2), LEVELS),
    "zones": hierarchy(PreciseGreyTile(ROW, error=5), LEVELS, zones=64),
    "wild": hierarchy(
        PreciseGreyTile(ROW, error=5), LEVELS, techniques=Techniques(virtual=3, conditioned=False)
    ),
}
every_world = pytest.mark.parametrize("name", WORLDS)
those_that_go_down = pytest.mark.parametrize("name", ["row", "floor", "zones"])
"""To the deepest level in each step; others go only one level deeper than before."""


def command(tiles, rng):
    shape = tiles.sensor.shape
    return rng.integers(-1, 2, len(shape)), rng.integers(np.array(shape) // 3, shape)


def driven(tiles, steps, seed=1):
    """The belief after commands and measurements by chance."""
    rng = np.random.default_rng(seed)
    bel = tiles.start(tiles.environment, Draws(seed))
    for step in range(1, steps + 1):
        bel, _ = tiles.step(bel, *command(tiles, rng), Draws(seed, step))
    return bel


def halved(low, high, depth, half):
    """Borders of a half."""
    low, high, axis = low.copy(), high.copy(), depth % len(low)
    middle = (low[axis] + high[axis]) / 2.0
    (high if half == 0 else low)[axis] = middle
    return low, high


def share_in(node, low, high, zones, half):
    """How much of a node's belief is in a box, or says the half."""
    x, w = node.particles.states, node.particles.weights
    if zones:
        return w[x[0] == half].sum() if half is not None else 1.0
    return w[((x > low[:, None]) & (x <= high[:, None])).all(axis=0)].sum()


@every_world
@pytest.mark.parametrize("steps", [1, 4, 12])
def test_the_probability_is_the_product_of_shares_inside(name, steps):
    """Π over the path of the mass in the next region over the mass inside; written out."""
    tiles = WORLDS[name]
    for seed in range(5):
        bel = driven(tiles, steps, seed)
        whole = tiles.domain.whole
        low, high, probability, outside = whole.low, whole.high, 1.0, 0.0
        for depth in range(len(bel.path) + 1):
            answer = tiles.query(bel, depth=depth)
            assert answer.depth == depth
            assert np.array_equal(answer.region.low, low)
            assert np.array_equal(answer.region.high, high)
            assert answer.probability == pytest.approx(probability)
            assert answer.outside == pytest.approx(outside, abs=1e-12)
            if depth == len(bel.path):
                break
            node, zones = bel.nodes[bel.path[depth]], name == "zones"
            halves = [halved(low, high, depth, half) for half in (0, 1)]
            masses = [share_in(node, *halves[k], zones, k) for k in (0, 1)]
            half = int(masses[1] > masses[0])
            if depth + 1 < len(bel.path):
                assert bel.path[depth + 1] == 2 * bel.path[depth] + half
            inside = share_in(node, low, high, zones, None)
            assert sum(masses) == pytest.approx(inside)
            probability *= masses[half] / inside
            outside = 1.0 - inside
            low, high = halves[half]


def test_some_of_the_belief_is_outside():
    """Else the test above would say little of it."""
    outside = [a.outside for seed in range(5) for a in driven(WORLDS["row"], 12, seed).answers()]
    assert max(outside) > 0.1


@every_world
def test_regions_are_nested_and_halve_in_turn(name):
    bel = driven(WORLDS[name], 6)
    answers = list(bel.answers())
    assert [a.depth for a in answers] == list(range(len(answers)))
    assert len(answers) == len(bel.path) + 1 >= 3
    for depth, (outer, inner) in enumerate(itertools.pairwise(answers)):
        assert (outer.region.low <= inner.region.low).all()
        assert (inner.region.high <= outer.region.high).all()
        axis = depth % outer.region.space.dimension
        assert inner.region.sides[axis] == 0.5 * outer.region.sides[axis]
        assert inner.region.sides.prod() == 0.5 * outer.region.sides.prod()
        assert inner.probability <= outer.probability


@pytest.mark.parametrize("name", ["row", "floor", "wild"])
def test_the_states_of_a_belief_weigh_in_a_region_what_it_answers(name):
    """Those that the path left behind, and all of the last node."""
    for seed in range(5):
        bel = driven(WORLDS[name], 8, seed)
        x, w = bel.particles.states, bel.particles.weights
        for answer in bel.answers():
            assert w[answer.region.holds(x)].sum() == pytest.approx(answer.probability)


@every_world
def test_the_particles_of_an_answer_are_the_belief_within_its_region(name):
    bel = driven(WORLDS[name], 8)
    for answer in bel.answers():
        found, node = answer.particles, answer.node
        assert isinstance(found, Particles)
        assert answer.region.holds(found.states).all()
        inside = answer.region.holds(node.states)
        assert np.array_equal(found.states, node.states[:, inside])
        expected = node.particles.weights[inside]
        assert found.weights == pytest.approx(expected / expected.sum())


@pytest.mark.parametrize("accuracy", [1000.0, 64.0, 40.0, 9.0, 1.0, 0.01])
@every_world
def test_the_first_region_that_is_small_enough_answers(name, accuracy):
    tiles = WORLDS[name]
    bel = driven(tiles, 6)
    answer, all_of_them = tiles.query(bel, accuracy=accuracy), list(bel.answers())
    fits = [a for a in all_of_them if a.region.sides.max() <= accuracy]
    assert answer.depth == (fits[0] if fits else all_of_them[-1]).depth
    assert tiles.query(bel).depth == tiles.query(bel, depth=50).depth == len(bel.path)


WRONG = [
    ({"depth": 2, "accuracy": 1.0}, "not for both"),
    ({"depth": -1}, "depth"),
    *(({"accuracy": value}, "accuracy") for value in (0.0, -1.0, np.nan)),
]


@pytest.mark.parametrize(("asked", "message"), WRONG)
def test_a_question_that_cannot_be_is_refused(asked, message):
    tiles = WORLDS["row"]
    with pytest.raises(ConfigError, match=message):
        tiles.query(tiles.start(tiles.environment, Draws(1)), **asked)


@every_world
def test_before_the_first_step_it_knows_that_all_is_possible(name):
    tiles = WORLDS[name]
    bel = tiles.start(tiles.environment, Draws(1))
    assert tiles.query(bel, depth=0).probability == 1.0
    assert tiles.query(bel).depth == 1
    assert tiles.query(bel).probability == pytest.approx(0.5, abs=0.5 * 4.5 / np.sqrt(60))


def test_a_node_whose_belief_is_all_outside_answers_for_its_own_region_only():
    """It has no states within; how probable it is the node above says."""
    tiles = WORLDS["row"]
    bel = driven(tiles, 3)
    key = bel.path[2]
    node = bel.nodes[key]
    far = Particles.equal(np.full((1, 60), node.region.high[0] + 1.0))
    gone = tiles.nodes.node(key, far, node.updated)
    changed = HierarchicalBelief({**bel.nodes, key: gone}, bel.path[:3], bel.step, bel.commands)
    last = tiles.query(changed)
    assert last.depth == 2
    assert last.region is gone.region
    assert last.particles is None
    assert last.probability == pytest.approx(tiles.query(bel, depth=2).probability)
    assert changed.particles.states[0].max() >= node.region.high[0] + 1.0
    *_, (after, _) = tiles.levels_of(changed, np.array([0]), np.array([64]), Draws(1, 4))
    assert len(after.path) >= 3


def cut(tiles, levels):
    return replace(tiles, levels=levels)


@every_world
def test_interrupted_after_any_level_it_is_the_filter_with_so_few_levels(name):
    """To the last bit, with the same random numbers."""
    tiles = WORLDS[name]
    for seed in range(3):
        bel, rng = driven(tiles, 5, seed), np.random.default_rng(seed + 100)
        u, z = command(tiles, rng)
        levels = 0
        for part, info in tiles.levels_of(bel, u, z, Draws(seed, 6)):
            levels += 1
            fewer, of_fewer = cut(tiles, levels).step(bel, u, z, Draws(seed, 6))
            assert same(part, fewer)
            assert replace(of_fewer, n=info.n, ess=info.ess) == info
            assert of_fewer.n == len(fewer.particles)
            assert of_fewer.ess == fewer.particles.ess
            assert info.sizes == (60,) * levels
            assert info.weighed == 60 * levels
            assert part.step == 6
            assert 0.0 < tiles.query(part).probability <= 1.0
        assert same(part, tiles.step(bel, u, z, Draws(seed, 6))[0])
        deepest = min(len(led(bel.nodes)) + 1, LEVELS) if name == "wild" else len(bel.path)
        assert levels == deepest


@those_that_go_down
def test_interrupted_after_any_level_it_answers_down_to_there(name):
    """From what this step has found. Deeper nodes keep what they had."""
    tiles = WORLDS[name]
    bel, rng = driven(tiles, 5), np.random.default_rng(7)
    u, z = command(tiles, rng)
    whole, _ = tiles.step(bel, u, z, Draws(1, 6))
    for k, (part, _) in enumerate(tiles.levels_of(bel, u, z, Draws(1, 6)), 1):
        assert part.path == whole.path[:k]
        assert [part.nodes[key].updated for key in part.path] == [6] * k
        assert tiles.query(part).depth == k
        for one, other in zip(part.answers(), whole.answers(), strict=False):
            assert np.array_equal(one.region.low, other.region.low)
            assert np.array_equal(one.region.high, other.region.high)
            assert (one.probability, one.outside) == (other.probability, other.outside)
        others = set(bel.nodes) - set(part.path)
        assert all(part.nodes[key] is bel.nodes[key] for key in others)


@those_that_go_down
def test_after_an_interruption_the_next_step_goes_on(name):
    """The nodes that were left out catch up: all levels are done, with as many particles."""
    tiles = WORLDS[name]
    for k in range(1, LEVELS):
        rng = np.random.default_rng(k)
        bel = driven(tiles, 5, 2)
        for step in range(6, 9):
            levels = tiles.levels_of(bel, *command(tiles, rng), Draws(2, step))
            for _ in range(k):
                bel, _ = next(levels)
        bel, info = tiles.step(bel, *command(tiles, rng), Draws(2, 9))
        assert info.weighed == 60 * LEVELS
        assert tiles.query(bel).depth == LEVELS
        assert sum(node.updated == 9 for node in bel.nodes.values()) == LEVELS
