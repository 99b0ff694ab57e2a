"""A belief is a value: it is saved whole, no step changes it, and threads make no difference."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from tests.filters.hierarchical.worlds import hierarchy, same

from mcloc.draws import Draws
from mcloc.filters.catalog import Composition
from mcloc.filters.hierarchical.nodes import FORGOTTEN
from mcloc.filters.hierarchical.region import ROOT
from mcloc.filters.hierarchical.techniques import Techniques
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.sensors.grey_tile import GreyTile
from mcloc.simulation import office_world

WORLDS = {
    "row": hierarchy(GreyTile((128,)), 7, 40, inherited=0.5),
    "floor": hierarchy(GreyTile((16, 8)), 7, 40, techniques=Techniques(virtual=3)),
    "zones": hierarchy(GreyTile((128,)), 7, 40, zones=64),
    "wandering": hierarchy(GreyTile((128,)), 7, 40, techniques=Techniques(stay=False)),
    "unconditioned": hierarchy(GreyTile((128,)), 7, 40, techniques=Techniques(conditioned=False)),
}
every_world = pytest.mark.parametrize("tiles", WORLDS.values(), ids=WORLDS)


def command(tiles, step):
    rng, shape = np.random.default_rng(step), tiles.sensor.shape
    return rng.integers(-1, 2, len(shape)), rng.integers(0, shape)


def go_on(tiles, bel, steps, levels=60):
    """The belief after so many further steps, of which only some levels were done."""
    for step in range(bel.step + 1, bel.step + steps + 1):
        for k, (part, _) in enumerate(tiles.levels_of(bel, *command(tiles, step), Draws(3, step))):
            found = part
            if k + 1 == levels:
                break
        bel = found
    return bel


def started(tiles):
    return tiles.start(tiles.environment, Draws(3))


def restored(tiles, bel):
    """Through text and a file of arrays, as a saved state is."""
    values, arrays = tiles.packed(bel)
    file = io.BytesIO()
    np.savez(file, **arrays)
    file.seek(0)
    with np.load(file, allow_pickle=False) as read:
        copies = {name: read[name] for name in arrays}
    return tiles.unpacked(json.loads(json.dumps(values)), copies, dict(bel.evidence))


@every_world
@pytest.mark.parametrize("steps", [0, 1, 6])
def test_what_is_restored_goes_on_with_the_same_bytes(tiles, steps):
    bel = go_on(tiles, started(tiles), steps)
    again = restored(tiles, bel)
    assert same(bel, again)
    assert same(go_on(tiles, bel, 6), go_on(tiles, again, 6))


def test_so_does_one_that_has_forgotten_nodes():
    tiles = WORLDS["row"]
    bel = go_on(tiles, started(tiles), FORGOTTEN + 3)
    again = restored(tiles, bel)
    assert same(bel, again)
    assert same(go_on(tiles, bel, 6), go_on(tiles, again, 6))


@every_world
@pytest.mark.parametrize("levels", [1, 3])
def test_so_does_one_that_was_interrupted(tiles, levels):
    bel = go_on(tiles, go_on(tiles, started(tiles), 5), 2, levels)
    again = restored(tiles, bel)
    assert same(bel, again)
    assert same(go_on(tiles, bel, 4), go_on(tiles, again, 4))


def frozen(bel):
    """No array of it can be written."""
    for node in bel.nodes.values():
        for a in (node.particles.states, node.particles.log_weights, node.half, node.states):
            a.flags.writeable = False
    return bel


@every_world
def test_a_step_leaves_the_belief_as_it_was(tiles):
    bel = frozen(go_on(tiles, started(tiles), 6))
    before, nodes, path = restored(tiles, bel), dict(bel.nodes), bel.path
    for _ in range(2):
        after = go_on(tiles, bel, 3)
        assert same(bel, before)
        assert bel.path is path
        assert all(bel.nodes[key] is nodes[key] for key in nodes)
        assert not same(after, bel)
    assert same(go_on(tiles, bel, 3), after)


@every_world
def test_other_seeds_have_other_beliefs(tiles):
    bel, u, z = started(tiles), *command(tiles, 1)
    one, again, other = (tiles.step(bel, u, z, Draws(seed, 1))[0] for seed in (1, 1, 2))
    assert same(one, again)
    assert not same(one, other)


def test_another_map_takes_over_the_particles_of_the_root():
    tiles = WORLDS["row"]
    bel = go_on(tiles, started(tiles), 6)
    adopted = hierarchy(GreyTile((128,)), 4, 40).adopted(bel)
    assert list(adopted.nodes) == [ROOT]
    assert adopted.path == (ROOT,)
    assert (adopted.step, adopted.commands, adopted.evidence) == (0, (), {})
    root = bel.nodes[ROOT].particles
    assert np.array_equal(adopted.particles.states, root.states)
    assert adopted.particles.weights == pytest.approx(root.weights)
    zones = WORLDS["zones"].adopted(go_on(WORLDS["zones"], started(WORLDS["zones"]), 3))
    assert zones.path == (ROOT,)
    assert go_on(tiles, adopted, 3).step == 3


class Dim:
    """log p(z | x) of a pose: how far it is from z, in no unit."""

    def log_likelihood(self, x, z):
        return -np.abs(x - z[:, None]).sum(axis=0)

    def readings(self, z):
        return 1.0

    def beams(self, z):
        return 1

    def source(self, z):
        return "dim"


def test_the_number_of_threads_makes_no_difference(set_threads):
    """As many particles as make threads worth it, on a map."""
    grid: OccupancyGrid = office_world(1)
    settings = {"filter": {"particles": 80_000, "levels": 4}}
    tree = replace(Composition("hierarchical", settings=settings).build(grid), sensor=Dim())
    found = []
    for threads in (1, 2):
        set_threads(threads)
        bel = tree.start(tree.environment, Draws(1))
        for step in (1, 2):
            z = tree.domain.whole.centre + 0.1 * step
            bel, _ = tree.step(bel, np.array([0.1, 0.0, 0.05]), z, Draws(1, step))
        found.append(bel)
    assert same(*found)
    assert len(found[0].nodes[ROOT].particles) == 80_000
