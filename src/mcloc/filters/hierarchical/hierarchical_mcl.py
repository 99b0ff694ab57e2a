"""A kd-tree of particle filters, which is updated along one path: which half of the domain, which
half of that, and so on  [Estivill-Castro, McKenzie: Hierarchical Monte-Carlo localisation balances
precision and speed, ACRA 2004].
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from mcloc.draws import Draws
from mcloc.errors import ConfigError
from mcloc.estimate import Hypothesis, hypotheses
from mcloc.filters.filter import StepInfo
from mcloc.filters.hierarchical.belief import Answer, HierarchicalBelief
from mcloc.filters.hierarchical.description import Description
from mcloc.filters.hierarchical.domain import Domain
from mcloc.filters.hierarchical.migration import handed_over
from mcloc.filters.hierarchical.node import Allocation, Node
from mcloc.filters.hierarchical.nodes import FORGOTTEN, PARTS, Nodes
from mcloc.filters.hierarchical.region import ROOT, depth_of
from mcloc.filters.hierarchical.sensing import Sensing
from mcloc.filters.hierarchical.techniques import Techniques
from mcloc.filters.particle_filter import Part, ParticleBelief, ParticleFilter
from mcloc.filters.recovery import Evidence, NoRandomParticles, Recovery
from mcloc.particles import Particles
from mcloc.protocols import Density, Environment, MotionModel, SensorModel
from mcloc.storage import Arrays


@dataclass(frozen=True)
class HierarchicalMCL:
    """Bel(x_t) as a tree: each node is a particle filter for a region, made of `parts` and of as
    many particles as the allocation has for its depth; its halves are the regions of its children.

    A step updates the root, then the child where more of the belief inside the root is, and so on,
    `levels` nodes in all. Nodes are made when the path first comes to them, of what the node above
    has in their region. One that the path comes back to first catches up with the commands that it
    has missed; what left its region thereby, while nobody looked, is replaced in the same way; and
    one that has missed more than FORGOTTEN is made anew. So there are never more than FORGOTTEN ·
    levels nodes, however deep the tree, where particles stay with their node.

    Measurements that nothing in a node explains leave it as it is.
    """

    motion: MotionModel
    sensor: SensorModel
    domain: Domain
    description: Description
    allocation: Allocation
    parts: Callable[[int], tuple[Part, ...]]
    sensing: Sensing
    techniques: Techniques
    levels: int
    inherited: float
    recovery: Recovery = field(default_factory=NoRandomParticles)

    @property
    def environment(self) -> Environment:
        """That of the domain."""
        return self.domain.environment

    @cached_property
    def nodes(self) -> Nodes:
        """Where nodes come from."""
        return Nodes(
            self.motion,
            self.sensor,
            self.domain,
            self.description,
            self.allocation,
            self.inherited,
        )

    def start(self, initial: Density, draws: Draws) -> HierarchicalBelief:
        """The root, drawn from a density; the other nodes follow when they are first visited."""
        states = initial.sample(draws, 0, self.allocation.at(0))
        region = self.domain.whole
        particles = Particles.equal(self.description.described(region, 0, states))
        return HierarchicalBelief({ROOT: self.nodes.node(ROOT, particles, 0)}, (ROOT,))

    def step(
        self, bel: HierarchicalBelief, u: Any, z: Any, draws: Draws
    ) -> tuple[HierarchicalBelief, StepInfo]:
        """The belief after moving by u and measuring z, down to the deepest level."""
        *_, (done, info) = self.levels_of(bel, u, z, draws)
        return done, replace(info, n=len(done.particles), ess=done.particles.ess)

    def levels_of(
        self, bel: HierarchicalBelief, u: Any, z: Any, draws: Draws
    ) -> Iterator[tuple[HierarchicalBelief, StepInfo]]:
        """The same, level by level: each belief is whole, and answers down to the level that was
        done. Who has no time for more takes the last one.

        Of what is learned, `sizes` and `weighed` count all levels so far, n and ess are of the last
        one, and log_evidence is that of the root.
        """
        step = bel.step + 1
        nodes = {key: n for key, n in bel.nodes.items() if step - n.updated <= FORGOTTEN}
        bel = replace(bel, step=step, commands=(*bel.commands[1 - FORGOTTEN :], u))
        planned = () if self.techniques.conditioned else self._planned(bel)
        path, above, root = [ROOT], None, None
        sizes: tuple[int, ...] = ()
        for depth in range(self.levels):
            key = path[depth]
            above = self.nodes.ready(nodes.get(key), above, key, bel, draws)
            node, info = self._updated(above, key, u, z, bel.evidence, draws)
            nodes = self._settled(nodes, key, node, bel, draws)
            root, sizes = root or info, (*sizes, *info.sizes)
            found = {**bel.evidence, self.sensor.source(z): info.evidence}
            ways = tuple(path) if self.techniques.conditioned else self._walk(nodes, step)
            done = replace(bel, nodes=nodes, path=ways, evidence=found)
            yield (
                done,
                replace(info, sizes=sizes, weighed=sum(sizes), log_evidence=root.log_evidence),
            )
            if planned[depth + 1 :]:
                path.append(planned[depth + 1])
            elif node.likelier is None or planned:
                return
            else:
                path.append(2 * key + node.likelier)

    def query(
        self, bel: HierarchicalBelief, *, depth: int | None = None, accuracy: float | None = None
    ) -> Answer:
        """The region at a depth (0: the whole domain), or the first one whose longest side along
        the straight axes is no longer than `accuracy`; with neither the smallest one. Where the
        belief does not go as deep the answer is the smallest region too.

        Raises ConfigError for both, a depth < 0, or an accuracy that is not > 0.
        """
        if depth is not None and accuracy is not None:
            raise ConfigError("ask for a depth or for an accuracy, not for both")
        if depth is not None and depth < 0:
            raise ConfigError(f"a depth must be >= 0, got {depth}")
        if accuracy is not None and not accuracy > 0.0:
            raise ConfigError(f"an accuracy must be > 0, got {accuracy}")
        for answer in bel.answers():
            if answer.depth == depth:
                break
            if accuracy is not None and answer.region.widest() <= accuracy:
                break
        return answer

    def hypotheses(self, bel: HierarchicalBelief) -> tuple[Hypothesis, ...]:
        """The modes of the whole belief, most likely first."""
        return hypotheses(bel.particles, self.domain.whole.space)

    def adopted(self, bel: HierarchicalBelief) -> HierarchicalBelief:
        """The particles of the root: another map may have other regions."""
        root = bel.nodes[ROOT]
        particles = Particles(
            self.description.described(self.domain.whole, 0, root.states),
            root.particles.log_weights,
        )
        return HierarchicalBelief({ROOT: self.nodes.node(ROOT, particles, 0)}, (ROOT,))

    def packed(self, bel: HierarchicalBelief) -> tuple[dict[str, Any], Arrays]:
        """The belief but for its evidence, as what JSON knows and as arrays."""
        nodes = list(bel.nodes.values())
        return {"path": bel.path, "step": bel.step, "keys": list(bel.nodes)}, {
            "updated": np.array([node.updated for node in nodes]),
            "counts": np.array([len(node.particles) for node in nodes]),
            "states": np.concatenate([node.particles.states for node in nodes], axis=1),
            "log_weights": np.concatenate([node.particles.log_weights for node in nodes]),
            "commands": np.array(bel.commands),
        }

    def unpacked(
        self, values: dict[str, Any], arrays: Arrays, evidence: dict[str, Evidence]
    ) -> HierarchicalBelief:
        """The belief that `packed` describes."""
        ends = np.cumsum(arrays["counts"])[:-1]
        states = np.split(arrays["states"], ends, axis=1)
        weights = np.split(arrays["log_weights"], ends)
        nodes = {
            key: self.nodes.node(key, Particles(np.ascontiguousarray(x), w), int(updated))
            for key, x, w, updated in zip(
                values["keys"], states, weights, arrays["updated"], strict=True
            )
        }
        commands = tuple(arrays["commands"])
        return HierarchicalBelief(nodes, tuple(values["path"]), values["step"], commands, evidence)

    def _updated(
        self,
        node: Node,
        key: int,
        u: Any,
        z: Any,
        evidence: Mapping[str, Evidence],
        draws: Draws,
    ) -> tuple[Node, StepInfo]:
        """A node after a command and a measurement: one step of its particle filter."""
        depth = depth_of(key)
        region, axis = self.nodes.region(key)
        sensor = self.sensing.of(self.sensor, region, z, depth < self.techniques.virtual)
        models = self.description.models(region, axis, self.motion, sensor)
        n = self.allocation.at(depth) if self.techniques.stay else len(node.particles)
        node_filter = ParticleFilter(
            *models, self.parts(n), self.recovery, space=self.description.space
        )
        before = ParticleBelief(node.particles, evidence)
        after, info = node_filter.step(before, u, z, draws.of_part(PARTS * depth))
        x = after.particles.states
        if self.techniques.collect and self.techniques.stay:
            x = self.description.collected(region, x)
        particles = Particles(x, after.particles.log_weights)
        return self.nodes.node(key, particles, node.updated + 1), info

    def _settled(
        self,
        nodes: Mapping[int, Node],
        key: int,
        node: Node,
        bel: HierarchicalBelief,
        draws: Draws,
    ) -> dict[int, Node]:
        """The nodes with an updated one; where particles do not stay with their node, after those
        that left its region have gone over to others.
        """
        if self.techniques.stay:
            return {**nodes, key: node}
        depth = depth_of(key)

        def now(other: Node) -> Particles:
            missed = bel.commands[len(bel.commands) - (bel.step - other.updated) :]
            return self.nodes.caught_up(other, depth, missed, draws)

        return handed_over(nodes, key, node, self.nodes.node, now)

    def _planned(self, bel: HierarchicalBelief) -> tuple[int, ...]:
        """The path that the nodes led along, whenever they were updated, and on to the next one."""
        path = self._walk(bel.nodes, 0)
        half = bel.nodes[path[-1]].likelier
        if half is None or len(path) >= self.levels:
            return path[: self.levels]
        return (*path, 2 * path[-1] + half)

    @staticmethod
    def _walk(nodes: Mapping[int, Node], since: int) -> tuple[int, ...]:
        """The path that nodes lead along which were updated since a step."""
        path = [ROOT]
        while (half := nodes[path[-1]].likelier) is not None:
            child = nodes.get(2 * path[-1] + half)
            if child is None or child.updated < since:
                break
            path.append(2 * path[-1] + half)
        return tuple(path)
