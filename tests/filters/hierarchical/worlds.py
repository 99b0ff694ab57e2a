"""Rows of tiles by the paper's words, and hierarchies over them."""

import numpy as np

from mcloc.draws import Draws
from mcloc.environment import Tiles
from mcloc.filters.hierarchical.description import FullStates
from mcloc.filters.hierarchical.domain import TileRows
from mcloc.filters.hierarchical.hierarchical_mcl import HierarchicalMCL
from mcloc.filters.hierarchical.node import Equal
from mcloc.filters.hierarchical.region import Region
from mcloc.filters.hierarchical.sensing import Sensing
from mcloc.filters.hierarchical.techniques import Techniques
from mcloc.filters.hierarchical.zones import ZoneOnly
from mcloc.filters.particle_filter import Part
from mcloc.filters.recovery import NoRandomParticles
from mcloc.motion.tiles import TileMotion
from mcloc.particles import Particles
from mcloc.proposals.forward import Forward
from mcloc.proposals.renewed import Renewed
from mcloc.resampling import Systematic
from mcloc.sample_size import Fixed
from mcloc.sensors.low_resolution import LowResolution
from mcloc.statespace import LINE, PLANE


def rows(*shape):
    """All tiles along one axis or two."""
    n = np.array(shape, dtype=float)
    space = LINE if len(shape) == 1 else PLANE
    return TileRows(Region(space, np.full(len(n), -0.5), n - 0.5), Tiles(shape))


def seen_from_afar(sensor, region):
    """The likelihood falls by 10 powers of e over the longest side of the region."""
    reach = [np.arange(-side, side + 1.0) for side in np.floor(region.sides)]
    offsets = np.stack(np.meshgrid(*reach, indexing="ij")).reshape(len(reach), -1)
    offsets = offsets[:, np.abs(offsets).sum(axis=0) > 0]
    return LowResolution(sensor, 1.0, offsets, 10.0 / region.widest() * np.abs(offsets).sum(axis=0))


def forward(share):
    """n -> MCL with n particles, a share of them random."""
    return lambda n: (Part(1.0, Renewed(Forward(Systematic()), share), Fixed(n)),)


def hierarchy(sensor, levels, n=60, **changes):
    """Over the tiles of a sensor, but for what is changed."""
    domain = changes.pop("domain", None) or rows(*sensor.shape)
    techniques = changes.pop("techniques", Techniques(virtual=0))
    dimension = domain.whole.space.dimension
    zones = changes.pop("zones", 0)
    parts = {
        "motion": TileMotion(sensor.shape) if hasattr(sensor, "shape") else None,
        "sensor": sensor,
        "domain": domain,
        "description": ZoneOnly(domain, zones) if zones else FullStates(domain, np.ones(dimension)),
        "allocation": Equal(particles=n),
        "parts": forward(techniques.random),
        "sensing": Sensing(seen_from_afar),
        "techniques": techniques,
        "levels": levels,
        "inherited": 0.0,
        "recovery": NoRandomParticles(doubt_below=0.0),
    }
    return HierarchicalMCL(**(parts | changes))


class Shift:
    """A move by u tiles, without noise."""

    def sample(self, x, u, draws, first):
        return x + u

    def doubted(self):
        return self


class Blind:
    """A sensor that knows nothing of a row of so many tiles."""

    def __init__(self, tiles):
        self.shape = (tiles,)

    def log_likelihood(self, x, z):
        return np.zeros(x.shape[1])

    def readings(self, z):
        return 1.0

    def source(self, z):
        return "blind"


def node_on(tiles, key, x, updated=5, weights=None):
    """A node of a hierarchy with such particles."""
    w = np.ones(len(x)) if weights is None else np.array(weights)
    return tiles.nodes.node(
        key, Particles.normalized(np.array([x], dtype=float), np.log(w)), updated
    )


def driven(tiles, steps, seed=1):
    """Beliefs after each step, of commands and measurements by chance."""
    rng, shape = np.random.default_rng(seed), tiles.sensor.shape
    bel = tiles.start(tiles.environment, Draws(seed))
    for step in range(1, steps + 1):
        u, z = rng.integers(-1, 2, len(shape)), rng.integers(0, shape)
        bel, _ = tiles.step(bel, u, z, Draws(seed, step))
        yield bel


def led(nodes):
    """The path that nodes lead along, whenever they were updated."""
    path = [1]
    while (half := nodes[path[-1]].likelier) is not None and 2 * path[-1] + half in nodes:
        path.append(2 * path[-1] + half)
    return path


def transition(action, tiles):
    """(tiles, tiles): p(x_t | action, x_{t−1}) by the words of the paper, x_{t−1} by row."""
    p = np.zeros((tiles, tiles))
    for x in range(tiles):
        possible = [t for t in (x - 1, x, x + 1) if 0 <= t < tiles]
        meant = x + action if x + action in possible else x
        failures = [t for t in possible if t != meant]
        p[x, meant] = 0.5
        for t in failures:
            p[x, t] = 0.5 / len(failures)
    return p


def grey(z, tiles):
    """(tiles,): p(z | x) by the words of the paper."""
    r = 1.0 / (1.0 + np.abs(np.arange(tiles)[:, None] - np.arange(tiles)))
    return (r / r.sum(axis=0))[z]


def histogram(particles, tiles):
    """(tiles,): how much of the belief is on each."""
    return np.bincount(particles.states[0].astype(int), particles.weights, tiles)


def same(one, other):
    """Whether two beliefs are the same to the last bit."""
    return (
        one.path == other.path
        and one.step == other.step
        and list(one.nodes) == list(other.nodes)
        and np.array_equal(np.array(one.commands), np.array(other.commands))
        and one.evidence == other.evidence
        and all(same_node(one.nodes[key], other.nodes[key]) for key in one.nodes)
    )


def same_node(one, other):
    """Whether two nodes are."""
    return (
        one.updated == other.updated
        and one.particles.states.tobytes() == other.particles.states.tobytes()
        and one.particles.log_weights.tobytes() == other.particles.log_weights.tobytes()
        and one.half.tobytes() == other.half.tobytes()
        and one.states.tobytes() == other.states.tobytes()
        and np.array_equal(one.region.low, other.region.low)
        and np.array_equal(one.region.high, other.region.high)
    )
