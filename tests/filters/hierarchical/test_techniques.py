"""The five techniques: each switch changes what it says, and nothing else."""

import numpy as np
import pytest
from tests.filters.hierarchical.worlds import (
    Blind,
    Shift,
    driven,
    forward,
    hierarchy,
    led,
    node_on,
    seen_from_afar,
)

from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.experiments import tile_world
from mcloc.filters.catalog import Composition
from mcloc.filters.hierarchical.belief import HierarchicalBelief
from mcloc.filters.hierarchical.node import Equal
from mcloc.filters.hierarchical.region import ROOT, depth_of, keys_of, region_of
from mcloc.filters.hierarchical.sensing import Sensing
from mcloc.filters.hierarchical.techniques import Techniques
from mcloc.filters.particle_filter import Part
from mcloc.maps.occupancy import FREE, OccupancyGrid
from mcloc.proposals.renewed import Renewed
from mcloc.sensors.grey_tile import GreyTile, PreciseGreyTile
from mcloc.sensors.low_resolution import LeftOut, LowResolution

SENSOR = PreciseGreyTile((64,), error=2)
PAPER = Techniques()


def test_the_defaults_are_those_of_the_paper():
    assert Techniques() == Techniques(
        stay=True, collect=True, virtual=3, random=0.1, conditioned=True
    )


# 1. Particles stay with their node


@pytest.mark.parametrize("zones", [0, 16])
def test_particles_that_stay_leave_every_node_as_many(zones):
    tiles = hierarchy(SENSOR, 6, 30, zones=zones)
    for bel in driven(tiles, 30):
        assert {len(node.particles) for node in bel.nodes.values()} == {30}


# 2. States outside a node's region are collected


class Leap:
    """Without noise, far."""

    def sample(self, x, u, draws, first):
        return x + 7.0

    def doubted(self):
        return self


@pytest.mark.parametrize("collect", [True, False])
def test_states_outside_are_kept_near_the_region_or_left_where_they_are(collect):
    """The node of tiles 0 … 15 has particles on 8 … 15, which are led by 7 to 15 … 22: with it
    those outside are brought back to 16, without it they stay. The node above has its own.
    """
    chosen = Techniques(virtual=0, collect=collect, random=0.0)
    sensor = Blind(64)
    tiles = hierarchy(sensor, 3, 8, motion=Leap(), techniques=chosen)
    nodes = {key: node_on(tiles, key, range(8)) for key in (1, 2)}
    nodes[4] = node_on(tiles, 4, range(8, 16))
    bel = HierarchicalBelief(nodes, (1, 2, 4), 5)
    bel, _ = tiles.step(bel, np.array([0]), None, Draws(1, 6))
    assert bel.path == (1, 2, 4)
    node = bel.nodes[4]
    assert node.updated == 6
    assert node.region.high[0] == 15.5
    expected = [15] + [16] * 7 if collect else range(15, 23)
    assert sorted(node.particles.states[0]) == list(expected)
    assert sorted(bel.nodes[2].particles.states[0]) == list(range(7, 15))
    assert node.shares == pytest.approx((0.0, 1.0 / 8.0, 7.0 / 8.0))


def test_far_states_are_there_only_where_they_are_not_collected():
    far = {}
    for collect in (True, False):
        tiles = hierarchy(SENSOR, 6, 30, techniques=Techniques(collect=collect))
        *_, bel = driven(tiles, 30)
        nodes = bel.nodes.values()
        far[collect] = max(np.abs(n.region.beyond(n.particles.states)).max() for n in nodes)
    assert far[True] <= 1.0 < far[False]


# 3. Virtual low-resolution sensors


@pytest.mark.parametrize("virtual", [0, 1, 3, 60])
def test_so_many_levels_have_virtual_sensors(virtual):
    asked = []

    def from_afar(sensor, region):
        asked.append(region)
        return seen_from_afar(sensor, region)

    chosen = Techniques(virtual=virtual)
    tiles = hierarchy(SENSOR, 6, 30, techniques=chosen, sensing=Sensing(from_afar))
    *_, bel = driven(tiles, 1)
    expected = [region_of(tiles.domain.whole, key) for key in bel.path[:virtual]]
    assert [id(r) for r in asked] == [id(r) for r in expected]


def test_the_sensor_of_a_node():
    """Virtual near the root, else as it is but positive everywhere; a coarse one is left out where
    it tells nothing apart.
    """
    whole = hierarchy(SENSOR, 6).domain.whole
    sensing = Sensing(seen_from_afar, {"grey": 4.0})
    z, x = np.array([10]), np.arange(64.0)[None]
    precise = sensing.of(SENSOR, region_of(whole, 4), z, shallow=False)
    assert isinstance(precise, LowResolution)
    p, found = SENSOR.log_likelihood(x, z), precise.log_likelihood(x, z)
    assert np.array_equal(found, np.maximum(p, -600.0))
    virtual = sensing.of(SENSOR, region_of(whole, 4), z, shallow=True)
    expected = seen_from_afar(SENSOR, region_of(whole, 4)).log_likelihood(x, z)
    assert np.array_equal(virtual.log_likelihood(x, z), expected)
    for key in range(1, 64):
        for shallow in (False, True):
            left_out = isinstance(sensing.of(SENSOR, region_of(whole, key), z, shallow), LeftOut)
            assert left_out == (64.0 / 2 ** depth_of(key) < 4.0)
    elsewhere = Sensing(seen_from_afar, {"laser": 5.0})
    assert not isinstance(elsewhere.of(SENSOR, region_of(whole, 63), z, False), LeftOut)


def test_a_coarse_sensor_that_is_left_out_does_not_weigh_particles():
    tiles = hierarchy(
        GreyTile((64,)),
        6,
        30,
        techniques=Techniques(virtual=0, random=0.0),
        sensing=Sensing(seen_from_afar, {"grey": 10.0}),
    )
    *_, bel = driven(tiles, 3)
    for key in bel.path:
        equal = np.ptp(bel.nodes[key].particles.log_weights) < 1e-12
        assert equal == (64.0 / 2 ** depth_of(key) < 10.0)


# 4. Random particles


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5])
def test_the_share_of_random_particles(share):
    """Of a robot that stands still and sees nothing: those that were not there before."""

    def new_ones(n):
        sensor = Blind(2**30)
        chosen = Techniques(virtual=0, random=share, collect=False)
        tiles = hierarchy(sensor, 4, n, motion=Shift(), techniques=chosen, parts=forward(share))
        bel = tiles.start(tiles.environment, Draws(1))
        bel, _ = tiles.step(bel, np.array([0.0]), None, Draws(1, 1))
        after, _ = tiles.step(bel, np.array([0.0]), None, Draws(1, 2))
        return [
            int((~np.isin(after.nodes[k].particles.states, bel.nodes[k].particles.states)).sum())
            for k in after.path
            if k in bel.nodes
        ]

    for n in (30, 37):
        assert set(new_ones(n)) <= {int(np.floor(share * n)), int(np.ceil(share * n))}


@pytest.mark.parametrize("collect", [False, True])
def test_random_particles_of_a_node_are_anywhere_in_the_domain(collect):
    """Before they are collected near its region."""
    chosen = Techniques(random=0.9, collect=collect)
    tiles = hierarchy(Blind(64), 5, 800, motion=Shift(), techniques=chosen)
    bel = tiles.start(tiles.environment, Draws(1))
    for step in (1, 2, 3):
        bel, _ = tiles.step(bel, np.array([0.0]), None, Draws(1, step))
    for key in bel.path:
        node = bel.nodes[key]
        low, high = (node.region.low[0] - 1.0, node.region.high[0] + 1.0)
        tile, n = np.unique(node.particles.states, return_counts=True)
        expected = [t for t in range(-1, 65) if low < t <= high] if collect else range(64)
        assert n.sum() == 800
        assert set(tile) <= set(expected)
        if not collect:
            random = np.bincount(node.particles.states[0].astype(int), minlength=64)
            outside = (np.arange(64) < node.region.low[0]) | (np.arange(64) > node.region.high[0])
            assert len(tile) == 64
            share = random[outside].sum() / 800.0
            assert share == pytest.approx(0.9 * outside.mean(), abs=0.07 + 0.1 * outside.mean())


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4])
def test_filters_by_name_and_of_the_tiles_have_that_share(share):
    room = OccupancyGrid(np.full((20, 20), FREE, dtype=np.int8), 0.1, np.zeros(3))
    named = Composition("hierarchical", settings={"filter": {"random": share}}).build(room)
    of_tiles = tile_world.hierarchy(SENSOR, Equal(particles=6), techniques=Techniques(random=share))
    assert isinstance(named.environment, FreeSpace)
    for tree in (named, of_tiles):
        (part,) = tree.parts(40)
        assert isinstance(part, Part)
        assert isinstance(part.proposal, Renewed)
        assert part.proposal.share == share == tree.techniques.random
        assert part.size.fixed == 40


# 5. The conditioned update


def updated(bel):
    """The nodes of the last step."""
    return {key for key, node in bel.nodes.items() if node.updated == bel.step}


def test_the_path_follows_the_updated_belief_or_the_one_before():
    """A robot that was near the first tile sees one of the last: with the conditioned update the
    nodes there are updated at once; else those on the old path are, though the root knows better.
    """
    for conditioned in (True, False):
        chosen = Techniques(virtual=1, conditioned=conditioned)
        tiles = hierarchy(SENSOR, 4, 60, techniques=chosen)
        bel = tiles.start(tiles.environment, Draws(1))
        for step in range(1, 11):
            bel, _ = tiles.step(bel, np.array([0]), np.array([2]), Draws(1, step))
        assert bel.path == (1, 2, 4, 8)
        bel, _ = tiles.step(bel, np.array([0]), np.array([60]), Draws(1, 11))
        assert tiles.query(bel, depth=1).region.low[0] == 31.5
        assert updated(bel) == ({1, 3, 7, 15} if conditioned else {1, 2, 4, 8})
        for step in range(12, 16):
            bel, _ = tiles.step(bel, np.array([0]), np.array([60]), Draws(1, step))
        assert updated(bel) == {1, 3, 7, 15}
        assert bel.path == (1, 3, 7, 15)


def test_without_it_nodes_of_the_path_before_are_updated():
    """And the one that the path led to, and only they answer; with it those of the path that is
    found.
    """
    other = 0
    for conditioned in (True, False):
        tiles = hierarchy(SENSOR, 6, 20, techniques=Techniques(conditioned=conditioned))
        before = tiles.start(tiles.environment, Draws(1))
        for bel in driven(tiles, 40):
            planned = led(before.nodes)
            last = before.nodes[planned[-1]]
            if len(planned) < 6 and last.likelier is not None:
                planned.append(2 * planned[-1] + last.likelier)
            assert updated(bel) == set(bel.path if conditioned else planned)
            assert set(bel.path) <= updated(bel)
            other += set(bel.path) != set(planned)
            before = bel
    assert other > 20


def test_measurements_that_nothing_explains_change_no_weight():
    """A node that has no particle near what was seen, and no virtual sensor."""
    tiles = hierarchy(SENSOR, 1, 20, techniques=Techniques(virtual=0, random=0.0))
    bel = HierarchicalBelief({ROOT: node_on(tiles, ROOT, [5] * 10 + [50] * 10)}, (ROOT,), 5)
    after, _ = tiles.step(bel, np.array([0]), np.array([30]), Draws(1, 6))
    node = after.nodes[ROOT]
    assert node.shares[:2] == pytest.approx((0.5, 0.5))
    assert np.ptp(node.particles.log_weights) == 0.0
    assert (keys_of(node.region, node.particles.states, 1) > 0).all()
