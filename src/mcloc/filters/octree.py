"""Markov localization on an octree of poses: fine where the belief is, coarse where it is not
[Burgard, Derr, Fox, Cremers: Integrating global position estimation and position tracking for
mobile robots: the dynamic Markov localization approach, IROS 1998].
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from mcloc.draws import Draws
from mcloc.errors import FilterError
from mcloc.estimate import Hypothesis, away, hypotheses
from mcloc.filters.filter import StepInfo
from mcloc.filters.models import Models
from mcloc.filters.octree_leaves import Leaves, Masses, divided, joined, looks, tree_of
from mcloc.filters.recovery import LITTLE, Evidence, Recovery
from mcloc.particles import Particles
from mcloc.protocols import Density, Environment, MotionModel, SensorModel
from mcloc.registry import Configurable, param
from mcloc.samplers.pose_boxes import PoseBoxes
from mcloc.statespace import SE2
from mcloc.storage import Arrays

SQUARE, HEADINGS = 1.6, 8  # m; about the largest boxes, and the parts of the circle that they are
STARTING = 100_000  # poses of a start that is not uniform


@dataclass(frozen=True, eq=False)
class OctreeBelief:
    """leaves: their masses add up to 1."""

    boxes: PoseBoxes
    leaves: Leaves
    evidence: Mapping[str, Evidence] = field(default_factory=dict)

    @cached_property
    def particles(self) -> Particles:
        """The middles of the leaves."""
        level, keys, mass = self.leaves
        states = np.empty((3, len(keys)))
        for k in np.unique(level):
            states[:, level == k] = self.boxes.poses(keys[level == k], int(k), np.full((3, 1), 0.5))
        with np.errstate(divide="ignore"):
            return Particles.normalized(states, np.log(mass))


@dataclass(frozen=True)
class OctreeFilter:
    """Bel(x) as a mass for each leaf of a tree of boxes.

    A box is divided in 8 where it has more than `most` of the belief, down to the level `deepest`.
    Prediction moves poses that are drawn in the leaves by the motion model, and builds the tree
    anew around where they come to: that merges what the belief has left. Measurement weighs poses
    drawn in the leaves by p(z | x) p(x | m), divides leaves that turn out to have too much, and
    weighs their parts.

    Boxes do not move along with the robot. Mass that comes to one is spread in it, which adds a
    sixth of the square of its side to the variance along each axis at each step.
    `carried_off` is α of (1 − α) p_d + α U, U over all the largest boxes that have a free cell.
    """

    boxes: PoseBoxes
    motion: MotionModel
    sensor: SensorModel
    environment: Environment
    recovery: Recovery
    most: float
    deepest: int
    carried_off: float

    def start(self, initial: Density, draws: Draws) -> OctreeBelief:
        """A tree of the environment, or of poses drawn from another density."""
        if initial is self.environment:
            return OctreeBelief(self.boxes, self._tree(1.0, np.empty((3, 0)), np.empty(0)))
        x = initial.sample(draws, 0, STARTING)
        return self._belief(self._tree(0.0, x, np.full(STARTING, 1.0 / STARTING)))

    def step(
        self, bel: OctreeBelief, u: Any, z: Any, draws: Draws
    ) -> tuple[OctreeBelief, StepInfo]:
        """The belief after moving by u and measuring z."""
        here = looks(self.boxes, bel.leaves, self.most, draws)
        x = self.motion.sample(here.x, u, draws, 0)
        leaves = self._tree(self.carried_off, x, (1.0 - self.carried_off) * here.mass)
        weighing = Weighing(self, z, draws)
        weights = weighing(leaves)
        while (
            heavy := (weights > self.most * weights.sum()) & (leaves.level < self.deepest)
        ).any():
            parts = divided(self.boxes, leaves.chosen(heavy))
            leaves = joined([leaves.chosen(~heavy), parts])
            weights = np.concatenate([weights[~heavy], weighing(parts)])
        after = self._belief(leaves._replace(mass=weights))
        source = self.sensor.source(z)
        evidence = bel.evidence.get(source, Evidence()).updated(
            weighing.likelihood,
            self.sensor.readings(z),
            self.recovery.rates,
            away(after.particles, SE2) <= LITTLE,
        )
        info = StepInfo(
            n=len(weights),
            ess=after.particles.ess,
            log_evidence=math.log(weights.sum()) + weighing.log_best,
            evidence=evidence,
            weighed=weighing.count,
            alpha=self.carried_off,
        )
        return replace(after, evidence={**bel.evidence, source: evidence}), info

    def hypotheses(self, bel: OctreeBelief) -> tuple[Hypothesis, ...]:
        """The modes of the leaves; each of the smallest is spread evenly over its sides."""
        within = np.diag(self.boxes.sides(self.deepest) ** 2 / 12.0)
        found = hypotheses(bel.particles, SE2)
        return tuple(replace(h, covariance=h.covariance + within) for h in found)

    def adopted(self, bel: OctreeBelief) -> OctreeBelief:
        """The tree of the same leaves on this map."""
        x, mass = bel.particles.states, bel.particles.weights
        return self._belief(self._tree(0.0, x, mass))

    def packed(self, bel: OctreeBelief) -> tuple[dict[str, Any], Arrays]:
        """The belief but for its evidence, as what JSON knows and as arrays."""
        return {}, bel.leaves._asdict()

    def unpacked(
        self, values: dict[str, Any], arrays: Arrays, evidence: dict[str, Evidence]
    ) -> OctreeBelief:
        """The belief that `packed` describes."""
        leaves = Leaves(*(arrays[name] for name in Leaves._fields))
        return OctreeBelief(self.boxes, leaves, evidence)

    def _tree(self, anywhere: float, x: Any, mass: Masses) -> Leaves:
        return tree_of(self.boxes, anywhere, x, mass, self.most, self.deepest)

    def _belief(self, leaves: Leaves) -> OctreeBelief:
        total = leaves.mass.sum()
        if not 0.0 < total < math.inf:
            raise FilterError(
                "no leaf of the octree is possible: off the map, or against all scans"
            )
        return OctreeBelief(self.boxes, leaves._replace(mass=leaves.mass / total))


class Weighing:
    """Weighs leaves by one measurement, in the order in which they are divided.

    likelihood: of one reading, over the leaves that were weighed first. log_best: what all weights
    are relative to. count: poses weighed.
    """

    def __init__(self, of: OctreeFilter, z: Any, draws: Draws) -> None:
        self.of, self.z, self.draws = of, z, draws
        self.likelihood, self.log_best, self.count, self.calls = 0.0, -math.inf, 0, 0

    def __call__(self, leaves: Leaves) -> Masses:
        """(n,): the mass of each times the mean of p(z | x) p(x | m) in it."""
        of, first = self.of, self.calls == 0
        self.calls += 1
        # Part 0 was for the moves.
        draws = self.draws.of_part(self.draws.part + self.calls)
        here = looks(of.boxes, leaves, of.most, draws)
        log_p = of.sensor.log_likelihood(here.x, self.z)
        log_weight = log_p + of.environment.log_prior(here.x)
        if first:
            readings = of.sensor.readings(self.z)
            self.likelihood = float(here.mass @ np.exp(log_p / readings) / here.mass.sum())
            self.log_best = float(log_weight.max())
        self.count += len(log_p)
        weight = here.mass * np.exp(log_weight - self.log_best)
        total: Masses = np.bincount(here.leaf, weight, len(leaves.keys)).astype(np.float64)
        return total


@dataclass(frozen=True)
class Octree(Configurable):
    """Markov localization on an octree of poses [Burgard 1998]: boxes of 1.6 m and 45° where hardly
    anything is believed, divided down to `cell` where the robot may be. It finds a robot anywhere,
    in little memory.

    Of recovery it takes how fast the averages follow; it has no use for random particles and for
    doubt in the wheels, nor for size, resampler, people and sampler.
    """

    cell: float = param(0.1, "m", "most side of the smallest boxes", low=0.01, high=1.6)
    most: float = param(
        1e-6, "", "share of the belief above which a box is divided", low=1e-8, high=0.1
    )
    carried_off: float = param(1e-4, "", "P(carried off since the last update)", above=0, high=0.99)

    def compose(self, models: Models) -> OctreeFilter:
        cells = max(round(SQUARE / models.grid.resolution), 1)
        boxes = PoseBoxes(models.grid, cells, HEADINGS)
        deepest = max(math.ceil(math.log2(boxes.sides(0)[0] / self.cell) - 1e-9), 0)
        return OctreeFilter(
            boxes,
            models.motion,
            models.sensor,
            models.environment,
            models.recovery,
            self.most,
            deepest,
            self.carried_off,
        )
