"""Nodes off the path: they are moved by the commands that they have missed, made anew when these
are too many, and take over what the node above has in their region.
"""

from dataclasses import replace

import numpy as np
import pytest
from tests.filters.hierarchical.worlds import Blind, Shift, hierarchy, node_on, rows

from mcloc.draws import Draws
from mcloc.filters.hierarchical.belief import HierarchicalBelief
from mcloc.filters.hierarchical.nodes import FORGOTTEN
from mcloc.filters.hierarchical.region import ROOT
from mcloc.filters.hierarchical.techniques import Techniques
from mcloc.motion.tiles import TileMotion
from mcloc.particles import Particles
from mcloc.sensors.grey_tile import GreyTile

TILES = 1024
QUIET = Techniques(virtual=0, random=0.0)


def tree(levels=3, n=8, **changes):
    return hierarchy(
        Blind(TILES), levels, n, **({"motion": Shift(), "techniques": QUIET} | changes)
    )


def believed(tiles, step, commands, **of_nodes):
    """A belief with nodes {key: (states, updated)}, all of it in the first quarter."""
    nodes = {int(k[1:]): node_on(tiles, int(k[1:]), *v) for k, v in of_nodes.items()}
    return HierarchicalBelief(nodes, (ROOT,), step, tuple(np.array([u]) for u in commands))


def step(tiles, bel, u, seed=1):
    return tiles.step(bel, np.array([u]), None, Draws(seed, bel.step + 1))[0]


@pytest.mark.parametrize("missed", [0, 1, 2, 7, FORGOTTEN - 1])
def test_a_node_is_moved_by_the_commands_that_it_has_missed(missed):
    """And then by the one of the step. Nodes that were on the path move by that alone."""
    tiles = tree(levels=2)
    rng = np.random.default_rng(1)
    moves = rng.integers(-1, 2, FORGOTTEN + 20) * 1.0
    now = len(moves)
    x = np.arange(100.0, 108.0)
    bel = believed(tiles, now, moves[1 - FORGOTTEN :], k1=(x, now), k2=(x, now - missed))
    after = step(tiles, bel, 2.0)
    expected = moves[now - missed :].sum() + 2.0
    assert missed < 3 or moves[now - missed :].any()
    assert sorted(after.nodes[2].particles.states[0]) == list(x + expected)
    assert sorted(after.nodes[ROOT].particles.states[0]) == list(x + 2.0)
    assert after.nodes[2].updated == after.nodes[ROOT].updated == now + 1


@pytest.mark.parametrize("missed", [FORGOTTEN, FORGOTTEN + 1, 10 * FORGOTTEN])
def test_one_that_has_missed_too_many_is_made_anew(missed):
    """Of random states of its region."""
    tiles = tree(levels=2, n=200)
    x = np.full(200, 100.0)
    commands = [1.0] * min(missed, FORGOTTEN - 1)
    bel = believed(tiles, 600, commands, k1=(x, 600), k2=(x, 600 - missed))
    after = step(tiles, bel, 0.0)
    found = after.nodes[2].particles.states[0]
    assert not np.isin(found, 100.0 + np.arange(-1, missed + 1)).all()
    assert len(np.unique(found)) > 100
    assert after.nodes[2].region.holds(found[None]).all()
    kept = believed(tiles, 600, commands, k1=(x, 600), k2=(x, 600), k3=(x + 600.0, 600 - missed))
    assert 3 not in step(tiles, kept, 0.0).nodes


def test_the_last_command_before_it_is_forgotten_leaves_it_as_it_was():
    """Off the path a node is the same object, until it is dropped."""
    tiles = tree(levels=2)
    x = np.arange(100.0, 108.0)
    bel = believed(tiles, 1, [0.0], k1=(x, 1), k2=(x, 1), k3=(x + 600.0, 1))
    waiting = bel.nodes[3]
    for k in range(1, FORGOTTEN + 3):
        bel = step(tiles, bel, 0.0)
        assert len(bel.commands) == min(k + 1, FORGOTTEN)
        if k <= FORGOTTEN:
            assert bel.nodes[3] is waiting
        else:
            assert 3 not in bel.nodes


def test_what_left_the_region_meanwhile_is_replaced():
    """The first quarter, 0 … 255: of 240 … 259 by 4 more than one beyond the border are outside,
    nobody looked where they went. Their weights stay.
    """
    tiles = tree(levels=3, n=20)
    x = np.arange(233.0, 253.0)
    weights = np.arange(1.0, 21.0)
    near = np.full(20, 100.0)
    bel = believed(
        tiles,
        9,
        [1.0, 2.0, 3.0],
        k1=(near, 9),
        k2=(near, 9),
        k4=(x, 6, weights),
    )
    draws = Draws(1, 10)
    ready = tiles.nodes.ready(
        bel.nodes[4],
        None,
        4,
        replace(bel, step=10, commands=(*bel.commands, np.array([0.0]))),
        draws,
    )
    found = ready.particles.states[0]
    moved = x + 6.0
    stayed = moved <= 256.5  # 255.5 and a margin of 1
    assert 2 < stayed.sum() < 20
    assert np.array_equal(found[stayed], moved[stayed])
    assert (found[~stayed] <= 255.0).all()
    assert not np.array_equal(found[~stayed], moved[~stayed])
    assert np.array_equal(ready.particles.log_weights, bel.nodes[4].particles.log_weights)
    assert ready.updated == 9


def test_what_is_missed_has_its_own_noise_each_time():
    """TileMotion: the mean and the variance of 10 steps to the right, each of which succeeds with ½
    and fails to stay or step back with ¼: + ¼ tile and 11/16 a step.
    """
    n = 4000
    tiles = hierarchy(GreyTile((TILES,)), 2, n, techniques=QUIET, motion=TileMotion((TILES,)))
    x = np.full(n, 200.0)
    bel = believed(tiles, 10, [1] * 10, k1=(x, 10), k2=(x, 0))
    now = replace(bel, step=11, commands=(*bel.commands, np.array([0])))
    found = tiles.nodes.ready(bel.nodes[2], None, 2, now, Draws(1, 11)).particles.states[0]
    variance = 11.0 / 16.0
    assert found.mean() == pytest.approx(202.5, abs=4.5 * np.sqrt(10 * variance / n))
    spread = np.var(found, ddof=1)
    assert spread == pytest.approx(10 * variance, abs=4.5 * 10 * variance * np.sqrt(2.0 / n))


@pytest.mark.parametrize("inherited", [0.0, 0.3, 0.5, 1.0])
def test_a_new_node_takes_over_a_share_from_the_one_above(inherited):
    """Those that the command leads into its region: 25 of 30, of which 20 are in it before. The
    others are random ones of the region.
    """
    tiles = tree(levels=2, n=300, inherited=inherited)
    x = np.concatenate([np.arange(492.0, 512.0), np.arange(512.0, 522.0)]) + 0.25
    weights = np.concatenate([np.full(20, 3.0), np.full(10, 1.0)])
    bel = believed(tiles, 5, [0.0] * 5, k1=(x, 5, weights))
    after = step(tiles, bel, -5.0)  # 497.25 … 516.25 are led to 492.25 … 511.25
    assert after.path == (ROOT, 2)
    found = after.nodes[2].particles.states[0]
    from_above = found[found % 1.0 == 0.25]
    assert len(found) == 300
    assert len(from_above) == round(inherited * 300)
    led = x[x - 5.0 <= 511.5] - 5.0
    assert np.isin(from_above, led).all()
    if inherited == 1.0:
        # By weight: 20 heavy ones and 5 light ones share 300 places as 60 to 5.
        n = np.bincount(np.searchsorted(led, from_above), minlength=len(led))
        w = np.where(led < 507.0, 3.0, 1.0) / (20 * 3.0 + 5 * 1.0)
        assert len(led) == 25
        assert (np.abs(n - 300.0 * w) < 1.0).all()


def test_one_that_comes_back_keeps_the_rest_of_its_own():
    """Its own 30, moved by what it has missed, make room for 15 from above."""
    tiles = tree(levels=2, n=30, inherited=0.5)
    above, own = np.arange(100.0, 130.0) + 0.25, np.arange(200.0, 230.0) + 0.5
    bel = believed(tiles, 5, [1.0] * 5, k1=(above, 5), k2=(own, 2))
    found = step(tiles, bel, 7.0).nodes[2].particles.states[0]
    from_above, kept = found[found % 1.0 == 0.25], found[found % 1.0 == 0.5]
    assert len(from_above) == len(kept) == 15
    assert np.isin(from_above, above + 7.0).all()
    assert np.isin(kept, own + 3.0 + 7.0).all()
    assert len(np.unique(kept)) == len(np.unique(from_above)) == 15


def test_one_that_was_on_the_path_takes_over_nothing():
    tiles = tree(levels=2, n=30, inherited=0.5)
    above, own = np.arange(100.0, 130.0) + 0.25, np.arange(200.0, 230.0) + 0.5
    bel = believed(tiles, 5, [1.0] * 5, k1=(above, 5), k2=(own, 5))
    found = step(tiles, bel, 7.0).nodes[2].particles.states[0]
    assert sorted(found) == list(own + 7.0)


def test_nothing_is_taken_over_where_nothing_is_led_into_the_region():
    """Zero weights count for nothing, too."""
    tiles = tree(levels=2, n=30, inherited=0.5)
    above = np.concatenate([np.full(29, 505.25), [700.0]])
    bel = believed(tiles, 5, [1.0] * 5, k1=(above, 5))
    after = step(tiles, bel, 600.0)  # of the root nothing is left inside
    assert after.path == (ROOT,)
    light = believed(tiles, 5, [1.0] * 5, k1=(above, 5, [1e-300] * 29 + [1.0]))
    with np.errstate(divide="ignore"):
        none = tiles.nodes.node(
            ROOT, Particles(light.nodes[1].particles.states, np.log([0.0] * 29 + [1.0])), 5
        )
    found = tiles.nodes.ready(None, none, 2, replace(light, step=6), Draws(1, 6)).particles.states[
        0
    ]
    assert (found % 1.0 == 0.0).all()
    assert rows(TILES).environment.contain(found[None]).all()


def test_levels_have_random_numbers_of_their_own():
    """Two nodes with the same particles do not move alike: of 2000 pairs as many agree as would by
    chance, 3/8 of (½, ¼, ¼) twice.
    """
    n = 2000
    tiles = hierarchy(GreyTile((TILES,)), 3, n, techniques=QUIET, motion=TileMotion((TILES,)))
    tiles = replace(tiles, sensor=Blind(TILES))
    x = np.full(n, 100.0)
    bel = believed(tiles, 5, [0] * 5, k1=(x, 5), k2=(x, 5), k4=(x, 5))
    after = step(tiles, bel, 0)
    assert after.path == (1, 2, 4)
    moved = [after.nodes[key].particles.states[0] for key in after.path]
    for one, other in ((0, 1), (0, 2), (1, 2)):
        alike = np.mean(moved[one] == moved[other])
        assert alike == pytest.approx(3 / 8, abs=4.5 * np.sqrt(3 / 8 * 5 / 8 / n))
