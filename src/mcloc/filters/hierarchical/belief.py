"""What a hierarchy believes: the nodes that there are, and the path to where the robot seems to
be.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from mcloc.filters.hierarchical.node import Node
from mcloc.filters.hierarchical.region import Region
from mcloc.filters.recovery import Evidence
from mcloc.particles import Particles
from mcloc.statespace import LogWeights, States


@dataclass(frozen=True, eq=False)
class Answer:
    """Where the robot is, as precisely as was asked.

    region: its region. probability: P(the robot is in it) = Π over the path of the mass of the
    next region over the mass inside the node. outside: how much of the belief of the node that
    decided last lies outside its own region. depth: how many halvings led to the region. node: the
    one whose belief it is. halves: of that node's region, those that are the answer's.
    """

    region: Region
    probability: float
    outside: float
    depth: int
    node: Node
    halves: tuple[int, ...]

    @property
    def particles(self) -> Particles | None:
        """The belief within the region, as states; None where there is none of it."""
        chosen = np.isin(self.node.half, self.halves)
        if not self.node.particles.weights[chosen].any():
            return None
        states = self.node.states[:, chosen]
        return Particles.normalized(states, self.node.particles.log_weights[chosen])


@dataclass(frozen=True, eq=False)
class HierarchicalBelief:
    """nodes: by key. path: the keys of those that the belief rests on, root first. step: how many
    there were. commands: the last ones, oldest first; what nodes off the path have missed.
    """

    nodes: Mapping[int, Node]
    path: tuple[int, ...]
    step: int = 0
    commands: tuple[Any, ...] = ()
    evidence: Mapping[str, Evidence] = field(default_factory=dict)

    def answers(self) -> Iterator[Answer]:
        """From the whole domain on, each next one in a half of the last one's region."""
        probability, outside = 1.0, 0.0
        for depth, key in enumerate(self.path):
            node = self.nodes[key]
            yield Answer(node.region, probability, outside, depth, node, (0, 1))
            probability *= self._share(node, self._half(depth))
            outside = node.shares[2]
        half = node.likelier
        if half is not None:
            region = node.region.halves(depth % node.region.space.dimension)[half]
            yield Answer(region, probability, outside, depth + 1, node, (half,))

    @cached_property
    def particles(self) -> Particles:
        """States that stand for the whole belief: of each node those in the half that the path did
        not go into, of the last one all that are inside.
        """
        states: list[States] = []
        log_weights: list[LogWeights] = []
        probability = 1.0
        for depth, key in enumerate(self.path):
            node = self.nodes[key]
            half = self._half(depth)
            if key == self.path[-1]:
                chosen = node.half >= 0 if node.inside > 0.0 else node.half < 0
            else:
                chosen = node.half == 1 - half
            here = node.inside or 1.0
            with np.errstate(divide="ignore"):
                log_weights.append(node.particles.log_weights[chosen] + np.log(probability / here))
            states.append(node.states[:, chosen])
            probability *= self._share(node, half)
        return Particles.normalized(np.concatenate(states, axis=1), np.concatenate(log_weights))

    def _half(self, depth: int) -> int:
        """Which half the path goes into; 0 where nothing tells."""
        if depth + 1 < len(self.path):
            return self.path[depth + 1] & 1
        return self.nodes[self.path[depth]].likelier or 0

    @staticmethod
    def _share(node: Node, half: int) -> float:
        """P(in the half | in the region), as the node has it."""
        return node.shares[half] / node.inside if node.inside > 0.0 else 0.0
