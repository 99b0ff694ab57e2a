"""What a hierarchy costs: Σ m_d along one path, and memory for the nodes that there are."""

import tracemalloc
from collections import deque
from dataclasses import replace

import numpy as np
import pytest
from tests.filters.hierarchical.worlds import hierarchy

from mcloc.draws import Draws
from mcloc.filters.catalog import Composition
from mcloc.filters.hierarchical.node import Equal, Halving
from mcloc.filters.hierarchical.nodes import FORGOTTEN
from mcloc.filters.hierarchical.techniques import Techniques
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.sensors.grey_tile import GreyTile
from mcloc.simulation import office_world

MOST = 100e6  # bytes, of a tree with 20 levels


@pytest.mark.parametrize("m", [1, 6, 1000])
def test_equal_nodes_sum_to_m_times_levels(m):
    for depth in range(60):
        assert sum(Equal(particles=m).at(d) for d in range(depth + 1)) == m * (depth + 1)


@pytest.mark.parametrize("depth", range(7))
def test_halved_nodes_sum_to_less_than_twice_the_root(depth):
    """m₀ (2 − 2^−d); with a floor no node has fewer."""
    halving = Halving(particles=64, floor=1)
    assert sum(halving.at(d) for d in range(depth + 1)) == 64 * (2.0 - 0.5**depth)
    with_floor = Halving(particles=36, floor=6)
    assert [with_floor.at(d) for d in range(7)] == [36, 18, 9, 6, 6, 6, 6]
    assert Halving(particles=1000, floor=1).at(59) == 1


class Counting:
    """A sensor that counts the states at which it is asked."""

    def __init__(self, sensor):
        self.sensor, self.shape, self.asked = sensor, sensor.shape, 0

    def log_likelihood(self, x, z):
        self.asked += x.shape[1]
        return self.sensor.log_likelihood(x, z)

    def readings(self, z):
        return self.sensor.readings(z)

    def source(self, z):
        return self.sensor.source(z)


ALLOCATIONS = {"equal": Equal(particles=40), "halving": Halving(particles=320, floor=10)}


@pytest.mark.parametrize("conditioned", [True, False])
@pytest.mark.parametrize("share", [0.0, 0.1])
@pytest.mark.parametrize("allocation", ALLOCATIONS.values(), ids=ALLOCATIONS)
def test_a_step_weighs_as_many_particles_as_its_path_has(allocation, share, conditioned):
    """By what it says, and by what the sensor was asked. Random particles are looked at once more:
    they take the places of others that had been weighed.
    """
    sensor = Counting(GreyTile((128,)))
    chosen = Techniques(virtual=0, random=share, conditioned=conditioned)
    tiles = hierarchy(sensor, 7, allocation=allocation, techniques=chosen)
    rng, bel = np.random.default_rng(1), tiles.start(tiles.environment, Draws(1))
    for step in range(1, 31):
        sensor.asked = 0
        z = rng.integers(0, 128, 1)
        bel, info = tiles.step(bel, np.array([0]), z, Draws(1, step))
        path = sum(n.updated == step for n in bel.nodes.values())
        expected = sum(allocation.at(d) for d in range(path))
        assert info.weighed == expected
        assert info.sizes == tuple(allocation.at(d) for d in range(path))
        assert expected * (1.0 + share) - path <= sensor.asked <= expected * (1.0 + share) + path
        assert path == 7 or not conditioned


class Somewhere:
    """A robot that is set down anywhere, and measures its state but for a little noise."""

    def __init__(self, whole):
        self.sides, self.circular = whole.sides, np.array(whole.space.circular)

    def log_likelihood(self, x, z):
        off = x - z[:, None]
        off[self.circular] = (off[self.circular] + np.pi) % (2.0 * np.pi) - np.pi
        return -20.0 * np.abs(off / self.sides[:, None]).sum(axis=0)

    def readings(self, z):
        return 1.0

    def beams(self, z):
        return 1

    def source(self, z):
        return "somewhere"


def carried_about(tree, steps, seed=1):
    """Beliefs of a robot that is set down somewhere else before each step: every path is new."""
    rng, whole = np.random.default_rng(seed), tree.domain.whole
    tree = replace(tree, sensor=Somewhere(whole))
    bel = tree.start(tree.environment, Draws(seed))
    for step in range(1, steps + 1):
        z = whole.low + whole.sides * rng.random(len(whole.low))
        bel, info = tree.step(bel, np.zeros(len(z)), z, Draws(seed, step))
        yield bel, info


def on_map(grid, **settings):
    """A tree of 20 levels on a map, by name."""
    chosen = {"levels": 20, "inherited": 0.5, **settings}
    return Composition("hierarchical", settings={"filter": chosen}).build(grid)


def test_there_are_never_more_nodes_than_the_last_steps_have_visited():
    """They are those of the paths since then; most of them are visited once."""
    tree, paths = on_map(office_world(1), particles=20, floor=20), []
    for step, (bel, _) in enumerate(carried_about(tree, 2 * FORGOTTEN), 1):
        paths.append(bel.path)
        assert set(bel.nodes) == set().union(*paths[-FORGOTTEN - 1 :])
        assert all(step - node.updated <= FORGOTTEN for node in bel.nodes.values())
        assert len(bel.path) <= 20
    assert len(bel.nodes) > 5 * FORGOTTEN


def buffer(a):
    """What an array is a view of."""
    while isinstance(a.base, np.ndarray):
        a = a.base
    return a


def size_of(bel):
    """Bytes of all arrays of a belief, each counted once."""
    arrays = [np.asarray(u) for u in bel.commands]
    for node in bel.nodes.values():
        particles, region = node.particles, node.region
        arrays += [particles.states, particles.log_weights, particles.weights]
        arrays += [node.half, node.states, region.low, region.high]
    return sum({id(buffer(a)): buffer(a).nbytes for a in arrays}.values())


def test_a_deep_tree_over_a_large_floor_stays_within_100_mb():
    """The arrays of its belief, with equal nodes."""
    m = 1000
    tree = on_map(office_world(1), halving=False, particles=m)
    ((bel, _),) = deque(carried_about(tree, FORGOTTEN + 2), maxlen=1)
    particles = m * len(bel.nodes)
    assert len(bel.nodes) > 0.5 * FORGOTTEN * 20
    assert 3 * 8 * particles < size_of(bel) < 50 * particles < MOST


def test_a_deep_tree_over_a_recorded_map_stays_within_100_mb(data_dir):
    """Its belief, all that a step makes, and what is kept anywhere, as the filter is by name."""
    tree = on_map(OccupancyGrid.load(data_dir / "intel" / "intel_train.yaml"))
    next(carried_about(tree, 1))
    tracemalloc.start()
    try:
        ((bel, _),) = deque(carried_about(tree, FORGOTTEN + 2), maxlen=1)
        kept, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(bel.nodes) > 0.5 * FORGOTTEN * 20
    assert size_of(bel) < kept < peak < MOST
