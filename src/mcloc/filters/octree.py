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
from mcloc.errors import ConfigError, FilterError
from mcloc.estimate import Hypothesis, away, hypotheses
from mcloc.filters.filter import StepInfo
from mcloc.filters.models import Models
from mcloc.filters.octree_leaves import (
    Leaves,
    Masses,
    divided,
    joined,
    looks,
    most_bytes,
    tree_of,
)
from mcloc.filters.recovery import LITTLE, Evidence, Recovery
from mcloc.particles import Particles, log_sum_exp
from mcloc.protocols import Density, Environment, MotionModel, SensorModel
from mcloc.registry import Configurable, param
from mcloc.samplers.pose_boxes import PoseBoxes
from mcloc.statespace import SE2, LogWeights, States
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
            leaves = self._tree(1.0, np.empty((3, 0)), np.empty(0))
            for some, here in looks(self.boxes, leaves, self.most, draws):
                density = here.mass * np.exp(initial.log_density(here.x))
                leaves.mass[some] = np.bincount(here.leaf, density)
        else:
            x = initial.sample(draws, 0, STARTING)
            leaves = self._tree(0.0, x, np.full(STARTING, 1.0 / STARTING))
        if not leaves.mass.any():
            raise ConfigError(f"{self.boxes.grid.name}: the start lies nowhere on the map")
        return self._belief(leaves.chosen(leaves.mass > 0.0))

    def step(
        self, bel: OctreeBelief, u: Any, z: Any, draws: Draws
    ) -> tuple[OctreeBelief, StepInfo]:
        """The belief after moving by u and measuring z."""
        leaves = self._predicted(bel, u, draws)
        weighing = Weighing(self, z, draws)
        weights = weighing(leaves)
        total = log_sum_exp(weights)
        least = math.log(self.most)
        while (heavy := (weights > least + total) & (leaves.level < self.deepest)).any():
            parts = divided(self.boxes, leaves.chosen(heavy))
            leaves = joined([leaves.chosen(~heavy), parts])
            weights = np.concatenate([weights[~heavy], weighing(parts)])
            total = log_sum_exp(weights)
        if not math.isfinite(total):
            raise FilterError("no leaf of the octree explains the scan at all")
        evidence = dict(bel.evidence)
        after = self._belief(leaves._replace(mass=np.exp(weights - total)), evidence)
        source, sure = self.sensor.source(z), away(after.particles, SE2) <= LITTLE
        now = evidence.get(source, Evidence()).updated(
            weighing.likelihood, self.sensor.readings(z), self.recovery.rates, sure
        )
        evidence[source] = now
        info = StepInfo(
            n=len(weights),
            ess=after.particles.ess,
            log_evidence=total,
            evidence=now,
            weighed=weighing.count,
            alpha=self.carried_off,
        )
        return after, info

    def hypotheses(self, bel: OctreeBelief) -> tuple[Hypothesis, ...]:
        """The modes of the leaves; each of the smallest is spread evenly over its sides."""
        within = np.diag(self.boxes.sides(self.deepest) ** 2 / 12.0)
        found = hypotheses(bel.particles, SE2)
        return tuple(replace(h, covariance=h.covariance + within) for h in found)

    def adopted(self, bel: OctreeBelief) -> OctreeBelief:
        """The tree of the same leaves on this map."""
        leaves = self._tree(0.0, bel.particles.states, bel.particles.weights)
        if not leaves.mass.any():
            raise FilterError("nothing of what was believed lies on the new map")
        return self._belief(leaves)

    def packed(self, bel: OctreeBelief) -> tuple[dict[str, Any], Arrays]:
        """The belief but for its evidence, as what JSON knows and as arrays."""
        return {}, bel.leaves._asdict()

    def unpacked(
        self, values: dict[str, Any], arrays: Arrays, evidence: dict[str, Evidence]
    ) -> OctreeBelief:
        """The belief that `packed` describes."""
        leaves = Leaves(*(arrays[name] for name in Leaves._fields))
        return OctreeBelief(self.boxes, leaves, evidence)

    def _predicted(self, bel: OctreeBelief, u: Any, draws: Draws) -> Leaves:
        """The leaves after moving by u."""
        moved, masses, done = [], [], 0
        for _, here in looks(self.boxes, bel.leaves, self.most, draws):
            moved.append(self.motion.sample(here.x, u, draws, done))
            masses.append(here.mass)
            done += len(here.mass)
        x, mass = np.concatenate(moved, axis=1), (1.0 - self.carried_off) * np.concatenate(masses)
        del moved, masses  # the same once more
        return self._tree(self.carried_off, x, mass)

    def _tree(self, anywhere: float, x: States, mass: Masses) -> Leaves:
        return tree_of(self.boxes, anywhere, x, mass, self.most, self.deepest)

    def _belief(
        self, leaves: Leaves, evidence: Mapping[str, Evidence] | None = None
    ) -> OctreeBelief:
        normalized = leaves._replace(mass=leaves.mass / leaves.mass.sum())
        return OctreeBelief(self.boxes, normalized, {} if evidence is None else evidence)


class Weighing:
    """Weighs leaves by one measurement, in the order in which they are divided.

    likelihood: of one reading, over the leaves that were weighed first. count: poses weighed.
    """

    def __init__(self, of: OctreeFilter, z: Any, draws: Draws) -> None:
        self.of, self.z, self.draws = of, z, draws
        self.likelihood, self.count, self.calls = 0.0, 0, 0

    def __call__(self, leaves: Leaves) -> LogWeights:
        """(n,): log of the mass of each times the mean of p(z | x) p(x | m) in it."""
        of, first = self.of, self.calls == 0
        self.calls += 1
        # Part 0 was for the moves.
        draws = self.draws.of_part(self.draws.part + self.calls)
        readings, likelihood = of.sensor.readings(self.z), 0.0
        found = np.empty(len(leaves.keys))
        for some, here in looks(of.boxes, leaves, of.most, draws):
            log_p = of.sensor.log_likelihood(here.x, self.z)
            weight = log_p + of.environment.log_prior(here.x)
            begins = np.searchsorted(here.leaf, np.arange(len(found[some])))
            with np.errstate(divide="ignore", invalid="ignore"):
                found[some] = np.logaddexp.reduceat(weight + np.log(here.mass), begins)
            likelihood += float((here.mass * np.exp(log_p / readings)).sum())
            self.count += len(log_p)
        if first:
            self.likelihood = likelihood / float(leaves.mass.sum())
        return found


@dataclass(frozen=True)
class Octree(Configurable):
    """Markov localization on an octree of poses [Burgard 1998]: boxes of 1.6 m and 45° where hardly
    anything is believed, divided down to `cell` where the robot may be. It finds a robot anywhere.

    How much memory a step takes is up to `most` more than to the map. While the robot may be
    anywhere there are up to 8 / `most` leaves: it took 0.4 GB on 100 m², 1 GB on 400 m² and 2.6 GB
    on 10,000 m². Once it is localized a step takes some megabytes.

    Of recovery it takes how fast the averages follow; it has no use for random particles and for
    doubt in the wheels, nor for size, resampler, people and sampler.
    """

    cell: float = param(0.1, "m", "most side of the smallest boxes", low=0.01, high=1.6)
    most: float = param(
        1e-6, "", "share of the belief above which a box is divided", low=1e-8, high=0.1
    )
    carried_off: float = param(1e-3, "", "P(carried off since the last update)", above=0, high=0.99)
    memory: float = param(4000.0, "MB", "most memory of a step", above=0)

    def compose(self, models: Models) -> OctreeFilter:
        cells = max(round(SQUARE / models.grid.resolution), 1)
        boxes = PoseBoxes(models.grid, cells, HEADINGS)
        deepest = max(math.ceil(math.log2(boxes.sides(0)[0] / self.cell) - 1e-9), 0)
        wanted = 1e-6 * most_bytes(boxes, self.most, deepest)
        if wanted > self.memory:
            raise ConfigError(
                f"{models.grid.name}: filter.most = {self.most:g} takes up to {wanted:.0f} MB on "
                f"this map, more than filter.memory = {self.memory:g} MB; use a larger filter.most"
            )
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
