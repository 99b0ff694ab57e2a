"""Bel(s_t) ∝ p(z_t | s_t) Σ_s p(s_t | u_t, s) Bel(s), s a place on the map's graph and a range of
headings: topological Markov localization  [Fox99; Nourbakhsh, Powers, Birchfield: DERVISH, AI
Magazine 1995; Simmons, Koenig: IJCAI 1995; Kaelbling, Cassandra, Kurien: IROS 1996].
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws
from mcloc.errors import ConfigError, FilterError
from mcloc.estimate import Hypothesis
from mcloc.filters.filter import StepInfo
from mcloc.filters.models import Models
from mcloc.filters.place_belief import PlaceBelief, moved_by
from mcloc.filters.place_states import TURNS, PlaceStates
from mcloc.filters.recovery import LITTLE, Evidence, Recovery
from mcloc.geometry import compose
from mcloc.maps.places import places
from mcloc.particles import log_sums_exp
from mcloc.protocols import Density, Environment, MotionModel, SensorModel
from mcloc.registry import Configurable, param
from mcloc.storage import Arrays

MOST_POSES = 2e7  # 24 bytes each, and as much again for what is computed of them
STARTS = 20_000  # samples of a start density
THROUGH_WALLS = 0.01  # p of a move between nodes that no passage joins, as of standing in a wall


@dataclass(frozen=True)
class TopologicalFilter:
    """A discrete Bayes filter over the graph of the map.

    p(z | s) is the mean of p(z | x) over the poses that stand for s. While the robot has moved by
    less than `distance` and `angle`, these poses move along and the states stay: the scans are what
    a robot sees that was in s, p(z_a … z_t | s) = mean Π p(z | x). Then the poses are moved by the
    motion model, and where they come to lie is p(s_t | u, s). This forgets where in s the robot
    was; done at each small move it would spread the belief along the graph faster than any robot
    drives.

    carried_off: α of (1 − α) p_d + α U whenever states change.
    """

    states: PlaceStates
    motion: MotionModel
    sensor: SensorModel
    environment: Environment
    recovery: Recovery
    distance: float = 1.0
    angle: float = math.pi / 4.0
    carried_off: float = 1e-4

    def start(self, initial: Density, draws: Draws) -> PlaceBelief:
        """The mass of each state, by samples of the density."""
        if initial is self.environment:
            return self._new(self._uniform)
        at = self.states.of(initial.sample(draws, 0, STARTS))
        return self._new(self._shares(at, np.full(STARTS, 1.0 / STARTS)))

    def step(self, bel: PlaceBelief, u: Any, z: Any, draws: Draws) -> tuple[PlaceBelief, StepInfo]:
        """The belief after moving by u (3,) and measuring z. Raises FilterError where it is 0
        everywhere.
        """
        expected = self._predicted(bel, u, draws)
        x = moved_by(self.states.poses, expected.moved)
        prior, log_p = self.environment.log_prior(x), self.sensor.log_likelihood(x, z)
        after = replace(expected, log_p=expected.log_p + prior + log_p)
        if not math.isfinite(after.log_total):
            raise FilterError("no place on the map explains the scan at all")
        source, readings = self.sensor.source(z), self.sensor.readings(z)
        total, of_one = log_sums_exp(expected.log_poses + prior, log_p, 0.0, 1.0 / readings)
        evidence = bel.evidence.get(source, Evidence()).updated(
            math.exp(of_one - total),
            readings,
            self.recovery.rates,
            after.hypotheses[0].share >= 1.0 - LITTLE,
        )
        info = StepInfo(
            n=len(after.mass),
            ess=1.0 / float((after.mass**2).sum()),
            log_evidence=after.log_total - expected.log_total,
            evidence=evidence,
            weighed=x.shape[1],
            alpha=self.carried_off,
        )
        return replace(after, evidence={**bel.evidence, source: evidence}), info

    def hypotheses(self, bel: PlaceBelief) -> tuple[Hypothesis, ...]:
        """Where on the graph; means and covariances of the poses there, by p(z | x)."""
        return bel.hypotheses

    def adopted(self, bel: PlaceBelief) -> PlaceBelief:
        """The mass of each state of this map, by the poses that lie there."""
        at = self.states.of(bel.particles.states)
        return self._new(self._shares(at, bel.particles.weights))

    def packed(self, bel: PlaceBelief) -> tuple[dict[str, Any], Arrays]:
        """The belief but for its evidence; the states are those of the map."""
        return {}, {"before": bel.before, "moved": bel.moved, "log_p": bel.log_p}

    def unpacked(
        self, values: dict[str, Any], arrays: Arrays, evidence: dict[str, Evidence]
    ) -> PlaceBelief:
        """The belief that `packed` describes."""
        before, moved, log_p = (arrays[name] for name in ("before", "moved", "log_p"))
        if (len(before), len(log_p)) != (len(self.states), len(self.states.state)):
            raise ValueError("states of another graph")
        return PlaceBelief(self.states, before, moved, log_p, evidence)

    @cached_property
    def _uniform(self) -> NDArray[np.float64]:
        uniform: NDArray[np.float64] = self.states.sizes / len(self.states.state)
        return uniform

    def _new(
        self, mass: NDArray[np.float64], evidence: Mapping[str, Evidence] | None = None
    ) -> PlaceBelief:
        """States just looked up."""
        nothing = np.zeros(3), np.zeros(len(self.states.state))
        return PlaceBelief(self.states, mass, *nothing, evidence or {})

    def _shares(self, of: NDArray[np.intp], weights: NDArray[np.float64]) -> NDArray[np.float64]:
        """(S,): the weight of each state."""
        shares: NDArray[np.float64] = np.bincount(of, weights, len(self.states)).astype(np.float64)
        return shares

    def _predicted(self, bel: PlaceBelief, u: Any, draws: Draws) -> PlaceBelief:
        """Moved by u: the poses alone, or the mass to other states."""
        u = compose(bel.moved, u)
        if math.hypot(u[0], u[1]) < self.distance and abs(u[2]) < self.angle:
            return replace(bel, moved=u)
        mass = (1.0 - self.carried_off) * self._transition(bel, u, draws)
        return self._new(mass + self.carried_off * self._uniform, bel.evidence)

    def _transition(
        self, bel: PlaceBelief, u: NDArray[np.float64], draws: Draws
    ) -> NDArray[np.float64]:
        """(S,): Σ_s p(s_t | u, s) Bel(s), by where the poses of all s come to lie."""
        states, held = self.states, bel.held
        was = states.state[held]
        x = self.motion.sample(states.poses[:, held], u, draws, 0)
        to = states.of(x)
        weight = (bel.mass / states.sizes)[was] * np.exp(self.environment.log_prior(x))
        weight *= np.where(states.near(was, to), 1.0, THROUGH_WALLS)
        if not weight.any():
            raise FilterError("no place on the map can be reached by this move")
        return self._shares(to, weight / weight.sum())


@dataclass(frozen=True)
class Topological(Configurable):
    """Topological Markov localization: a discrete Bayes filter over rooms, junctions and pieces of
    corridors, and ranges of headings. A baseline: it searches on the whole map, and gives but a
    rough sense of where the robot is.

    Of recovery it takes how fast the averages follow, and knows no doubt in the wheels; it has no
    use for size, resampler, people and sampler.
    """

    radius: float = param(
        0.25, "m", "half as wide as the narrowest passage that it drives", above=0, high=10
    )
    piece: float = param(3.0, "m", "length of the pieces of corridors", low=0.5, high=100)
    headings: int = param(8, "", "ranges of headings", low=1, high=360)
    spacing: float = param(0.25, "m", "between poses that stand for a place", low=0.01, high=10)
    distance: float = param(1.0, "m", "change states after driving this far", low=0, high=100)
    angle: float = param(math.pi / 4.0, "rad", "or after turning this far", low=0, high=math.pi)
    carried_off: float = param(
        1e-4, "", "P(carried off between changes of states)", low=0, high=0.99
    )

    def compose(self, models: Models) -> TopologicalFilter:
        # By all of free space, of which a robot fits into most: that is known before the graph,
        # which takes minutes and gigabytes for maps that are too large.
        area = np.count_nonzero(models.grid.free) * models.grid.resolution**2
        poses = area / self.spacing**2 * self.headings * TURNS
        if poses > MOST_POSES:
            raise ConfigError(
                f"filter.spacing = {self.spacing:g} m and filter.headings = {self.headings} make "
                f"{poses:.2g} poses of this map's free space, more than {MOST_POSES:.2g}: more "
                "space, or fewer"
            )
        graph = places(models.grid, self.radius, self.piece)
        return TopologicalFilter(
            PlaceStates(graph, self.headings, self.spacing),
            models.motion,
            models.sensor,
            models.environment,
            models.recovery,
            self.distance,
            self.angle,
            self.carried_off,
        )
