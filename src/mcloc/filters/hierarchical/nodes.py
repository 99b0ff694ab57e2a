"""Where nodes come from: made when they are first visited, brought up to date when the path comes
back to them  [Est §4, points 1 and 2].
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mcloc.draws import Draws, Stream
from mcloc.filters.hierarchical.belief import HierarchicalBelief
from mcloc.filters.hierarchical.description import Description
from mcloc.filters.hierarchical.domain import Domain
from mcloc.filters.hierarchical.node import Allocation, Node
from mcloc.filters.hierarchical.places import Places
from mcloc.filters.hierarchical.region import Region, depth_of, region_of
from mcloc.particles import Particles
from mcloc.protocols import MotionModel, SensorModel
from mcloc.resampling import comb
from mcloc.statespace import States

PARTS = 8  # of a node, at most: numbers of the random draws of one level
MOST_LEVELS = 60  # keys of nodes are 64-bit numbers
FORGOTTEN = 50  # commands that a node may have missed, before it is made anew


@dataclass(frozen=True)
class Nodes:
    """Makes nodes of a hierarchy; what the fields are, says HierarchicalMCL."""

    motion: MotionModel
    sensor: SensorModel
    domain: Domain
    description: Description
    allocation: Allocation
    inherited: float

    def node(self, key: int, particles: Particles, updated: int) -> Node:
        """What such particles say of a node's region."""
        region, axis = self.region(key)
        half = self.description.half(region, axis, particles.states)
        states = self.description.states(region, axis, particles.states)
        return Node(region, particles, half, states, updated)

    def region(self, key: int) -> tuple[Region, int]:
        """A node's region, and the axis along which it is halved."""
        whole = self.domain.whole
        return region_of(whole, key), depth_of(key) % whole.space.dimension

    def ready(
        self, node: Node | None, above: Node | None, key: int, bel: HierarchicalBelief, draws: Draws
    ) -> Node:
        """A node as it was before the last command: made, or moved by those that it has missed."""
        depth = depth_of(key)
        region, axis = self.region(key)
        new = _fresh(draws, depth)
        if node is None:
            n = self.allocation.at(depth)
            particles = Particles.equal(self._evenly(region, axis, n, new))
        else:
            missed = bel.commands[node.updated - bel.step : -1]
            if not missed:
                return node
            particles = self.caught_up(node, depth, missed, draws)
        if above is not None:
            particles = self._taken_over(particles, region, axis, above, bel.commands[-1], new)
        return self.node(key, particles, bel.step - 1)

    def caught_up(self, node: Node, depth: int, missed: Sequence[Any], draws: Draws) -> Particles:
        """Moved by the commands that a node has missed; what then is no longer near its region is
        replaced by new particles.
        """
        region, axis = node.region, depth % self.domain.whole.space.dimension
        motion, _, _ = self.description.models(region, axis, self.motion, self.sensor)
        x = node.particles.states
        for j, command in enumerate(missed):
            part = PARTS * MOST_LEVELS + FORGOTTEN * depth + j
            x = motion.sample(x, command, draws.of_part(part), 0)
        gone = ~self.description.near(region, x)
        x = np.where(gone, self._evenly(region, axis, x.shape[1], _fresh(draws, depth)), x)
        return Particles(x, node.particles.log_weights)

    def _evenly(self, region: Region, axis: int, n: int, draws: Draws) -> States:
        """(·, n): particles of a region, anywhere in it."""
        states = Places(self.domain, region).sample(draws, 0, n)
        return self.description.described(region, axis, states)

    def _taken_over(
        self, particles: Particles, region: Region, axis: int, above: Node, u: Any, draws: Draws
    ) -> Particles:
        """A node's particles, of which a share `inherited` has made room for those of the node
        above that the next command, u, leads into its region.
        """
        n = len(particles)
        taken = round(self.inherited * n)
        if taken == 0:
            return particles
        led = np.flatnonzero(region.holds(self.motion.sample(above.states, u, draws, 0)))
        w = above.particles.weights[led]
        if not w.any():
            return particles
        first, second = draws.uniform(Stream.ANCESTOR, 0, 1)[:2, 0].tolist()
        own = comb(particles.weights, first, n)[np.linspace(0.0, n, n - taken, False).astype(int)]
        states = above.states[:, led[comb(w / w.sum(), second, taken)]]
        from_above = self.description.described(region, axis, states)
        return Particles.equal(np.concatenate([particles.states[:, own], from_above], axis=1))


def _fresh(draws: Draws, depth: int) -> Draws:
    """The random numbers for what is new at a level."""
    return draws.of_part(PARTS * depth + PARTS - 1)
