"""Particles that leave a node's region for the node where they are: none is lost, and none is moved
twice.
"""

import numpy as np
import pytest
from tests.filters.hierarchical.worlds import Blind, Shift, driven, hierarchy, node_on

from mcloc.draws import Draws
from mcloc.filters.hierarchical.belief import HierarchicalBelief
from mcloc.filters.hierarchical.migration import handed_over
from mcloc.filters.hierarchical.region import OUTSIDE, ROOT
from mcloc.filters.hierarchical.techniques import Techniques
from mcloc.particles import Particles
from mcloc.sensors.grey_tile import GreyTile


def counts(bel):
    return {key: len(node.particles) for key, node in bel.nodes.items()}


@pytest.mark.parametrize("shape", [(64,), (8, 8)])
def test_else_they_go_over_to_where_they_are_and_none_is_lost(shape):
    """Nodes that are made bring their own. Only what is heaviest in a node that all would leave is
    in another's region.
    """
    sensor = GreyTile(shape)
    tiles = hierarchy(sensor, 5, 30, techniques=Techniques(virtual=0, stay=False, random=0.0))
    went = 0
    for seed in range(3):
        before = {ROOT: 30}
        for bel in driven(tiles, 30, seed):
            after = counts(bel)
            made = sum(30 for key in bel.path if key not in before)
            assert sum(after.values()) == sum(before.values()) + made
            for key in bel.path:
                out = bel.nodes[key].half == OUTSIDE
                assert out.sum() == (1 if out.all() else 0)
            went += sum(after[key] != before.get(key, 30) for key in after)
            before = after
    assert went > 100


def test_who_goes_over_keeps_its_weight_and_is_in_the_region_of_its_node():
    """Of 8 tiles, at depth 1: those of tile 5 and more go to node 3, those off the row stay."""
    tiles = hierarchy(GreyTile((8,)), 3, 4)
    root = node_on(tiles, ROOT, [1, 2, 5])
    node = node_on(tiles, 2, [0, 3, 4, 6, -3], weights=[1.0, 2.0, 3.0, 4.0, 5.0])
    other = node_on(tiles, 3, [7, 7], weights=[1.0, 3.0])
    nodes = {ROOT: root, 2: node, 3: other}
    moved = []

    def now(there):
        moved.append(there)
        return Particles(there.particles.states - 1.0, there.particles.log_weights)

    found = handed_over(nodes, 2, node, tiles.nodes.node, now)
    assert moved == [other]
    assert found[ROOT] is root
    assert found[2].particles.states.tolist() == [[0.0, 3.0, -3.0]]
    assert found[2].particles.weights == pytest.approx(np.array([1.0, 2.0, 5.0]) / 8.0)
    assert found[3].particles.states.tolist() == [[6.0, 6.0, 4.0, 6.0]]
    # Each set's weights are relative to their mean: 5 · (1, 2, …)/15 and 2 · (1, 3)/4.
    weights = np.array([0.5, 1.5, 3.0 / 3.0, 4.0 / 3.0])
    assert found[3].particles.weights == pytest.approx(weights / weights.sum())
    assert found[3].updated == found[2].updated == 5
    assert nodes == {ROOT: root, 2: node, 3: other}
    without = handed_over({ROOT: root}, 2, node, tiles.nodes.node, now)
    assert without[3].particles.states.tolist() == [[4.0, 6.0]]
    assert without[3].particles.weights == pytest.approx(np.array([3.0, 4.0]) / 7.0)


def test_a_node_that_all_would_leave_keeps_its_heaviest():
    tiles = hierarchy(GreyTile((8,)), 3, 4)
    root = node_on(tiles, ROOT, [1, 2, 5])
    node = node_on(tiles, 2, [5, 6, 7], weights=[1.0, 3.0, 2.0])
    found = handed_over({ROOT: root}, 2, node, tiles.nodes.node, None)
    assert found[2].particles.states.tolist() == [[6.0]]
    assert sorted(found[3].particles.states[0]) == [5.0, 7.0]


def test_who_goes_over_is_not_moved_once_more():
    """A node that has missed two commands catches up before others come to it: 20 and 21 are moved
    by −1 and −1 and by the third, what comes is where it is.
    """
    never = Techniques(virtual=0, stay=False, random=0.0)
    tiles = hierarchy(Blind(32), 2, 6, motion=Shift(), techniques=never)
    root = node_on(tiles, ROOT, [1, 2, 3, 4, 5, 30])
    left, right = node_on(tiles, 2, [10, 11, 12, 13, 14, 15]), node_on(tiles, 3, [20, 21])
    nodes = {ROOT: root, 2: left, 3: right}
    bel = HierarchicalBelief(nodes, (ROOT, 2), 5)
    # All nodes are of step 5; those on the path are updated by two commands first.
    for step in (6, 7):
        bel, _ = tiles.step(bel, np.array([-1.0]), None, Draws(1, step))
    bel, _ = tiles.step(bel, np.array([6.0]), None, Draws(1, 8))
    assert bel.path == (ROOT, 2)
    assert sorted(bel.nodes[2].particles.states[0]) == [14.0, 15.0]
    assert bel.nodes[3].particles.states[0].tolist() == [24.0, 25.0, 16.0, 17.0, 18.0, 19.0]
    assert bel.nodes[3].updated == 8


def test_zones_of_a_plane_have_nobody_to_hand_over():
    tiles = hierarchy(
        GreyTile((8, 8)), 6, 30, zones=16, techniques=Techniques(virtual=0, stay=False)
    )
    for bel in driven(tiles, 5):
        assert set(counts(bel).values()) == {30}
