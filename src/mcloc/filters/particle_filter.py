"""A filter is a tuple of parts φ_k, q_k, N_k; one step draws, weighs and normalizes  [Fox01
§19.2.3, §19.3.3].
"""

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from mcloc.draws import Draws
from mcloc.filters.recovery import Evidence, NoRandomParticles, Recovery
from mcloc.particles import Particles, log_sum_exp
from mcloc.proposals.target import Target
from mcloc.protocols import Density, Environment, MotionModel, SampleSize, SensorModel, Source
from mcloc.statespace import SE2, LogWeights, States, StateSpace


class Proposal(Protocol):
    """Draws particles and weighs them by target / q: it alone knows its q."""

    def prepare(self, target: Target, n: int | None, draws: Draws) -> tuple[Source, int | None]:
        """A source of weighted particles, and how many it has (None: as many as asked for).

        The mean of the weights estimates ∫ target.
        """


@dataclass(frozen=True, slots=True)
class Part:
    """A share φ of the belief, drawn by one proposal.

    Parts of the same group compete by evidence: their weights are normalized together. Each group
    keeps its share Σ φ of the belief, whatever its evidence; a group without any weight loses it to
    the others.
    """

    phi: float
    proposal: Proposal
    size: SampleSize
    group: int = 0


@dataclass(frozen=True, eq=False, slots=True)
class Belief:
    """What a particle filter carries from step to step."""

    particles: Particles
    evidence: Evidence = field(default_factory=Evidence)


@dataclass(frozen=True, slots=True)
class StepInfo:
    """What was learned on the way.

    n: particles. ess: effective sample size after weighing. log_evidence: log of the mean weight of
    the first part, an estimate of log p(z_t | d_{0…t−1}). alpha: the uniform share of the dynamics.
    doubt: the share of moves for which the wheels were not believed.
    """

    n: int
    ess: float
    log_evidence: float
    alpha: float
    doubt: float


@dataclass(frozen=True)
class ParticleFilter:
    """Bel(x_t) ∝ p(z_t | x_t) ∫ p(x_t | u_t, x_{t−1}) Bel(x_{t−1}) dx_{t−1}, by importance
    sampling.
    """

    motion: MotionModel
    sensor: SensorModel
    environment: Environment
    parts: tuple[Part, ...]
    recovery: Recovery = field(default_factory=NoRandomParticles)
    space: StateSpace = SE2

    def start(self, initial: Density, draws: Draws) -> Belief:
        """Particles drawn from an initial density, as many as the first part's size asks for."""

        def source(first: int, n: int) -> tuple[States, LogWeights]:
            return initial.sample(draws, first, n), np.zeros(n)

        states, _ = draw(source, self.parts[0].size, None, self.space)
        return Belief(Particles.equal(states))

    def step(self, bel: Belief, u: Any, z: Any, draws: Draws) -> tuple[Belief, StepInfo]:
        """The belief after moving by u and measuring z. Raises FilterError where every weight is 0.

        A scan that is explained much worse than usual makes the step be drawn once more, with doubt
        in the wheels.
        """
        alpha, doubt, readings = self.recovery.alpha(bel.evidence), 0.0, self.sensor.readings(z)
        drawn = self._draw(bel, u, z, alpha, doubt, draws)
        doubt = self.recovery.doubt(bel.evidence, float(np.exp(drawn.estimates[0] / readings)))
        if doubt > 0.0:
            drawn = self._draw(bel, u, z, alpha, doubt, draws)
        shifts = self._shifts(drawn)
        particles = Particles.normalized(
            np.concatenate(drawn.states, axis=1),
            np.concatenate([w + shift for w, shift in zip(drawn.log_weights, shifts, strict=True)]),
        )
        likelihood = float(np.exp(drawn.estimates[0] / readings))
        evidence = bel.evidence.updated(likelihood, self.recovery.rates)
        info = StepInfo(len(particles), particles.ess, drawn.estimates[0], alpha, doubt)
        return Belief(particles, evidence), info

    def _draw(
        self, bel: Belief, u: Any, z: Any, alpha: float, doubt: float, draws: Draws
    ) -> "_Drawn":
        """Weighted particles of every part, not yet normalized."""
        target = Target(
            bel.particles, u, z, alpha, doubt, self.motion, self.sensor, self.environment
        )
        drawn = []
        for k, part in enumerate(self.parts):
            source, n = part.proposal.prepare(target, part.size.fixed, draws.of_part(k))
            drawn.append(draw(source, part.size, n, self.space))
        states, log_weights = zip(*drawn, strict=True)
        estimates = [log_sum_exp(w) - float(np.log(len(w))) for w in log_weights]
        return _Drawn(list(states), list(log_weights), estimates)

    def _shifts(self, drawn: "_Drawn") -> list[float]:
        """What to add to the log weights of each part for its share of the belief.

        Within a group a particle of part k weighs φ_k / N_k; then each group is brought to its
        share Σ φ.
        """
        phis = np.array([part.phi for part in self.parts])
        evidence = np.log(phis) + np.array(drawn.estimates)
        shifts = np.log(phis) - np.log([len(w) for w in drawn.log_weights])
        for group in {part.group for part in self.parts}:
            members = np.array([part.group == group for part in self.parts])
            total = log_sum_exp(evidence[members])
            if np.isfinite(total):
                shifts[members] += np.log(phis[members].sum()) - total
        return [float(shift) for shift in shifts]


@dataclass(frozen=True, eq=False, slots=True)
class _Drawn:
    """One entry a part; estimates: log of the mean weight."""

    states: list[States]
    log_weights: list[LogWeights]
    estimates: list[float]


def draw(
    source: Source, rule: SampleSize, n: int | None, space: StateSpace
) -> tuple[States, LogWeights]:
    """n weighted particles, or as many as the rule asks for where n is None.

    They are drawn in chunks, but where drawing stops depends on the particles alone, not on the
    chunks.
    """
    if n is not None:
        return source(0, n)
    counter, drawn, chunks = rule.counter(space), 0, []
    while True:
        count = rule.fixed or max(1024, drawn // 4)
        states, log_weights = source(drawn, count)
        enough = counter.enough(states, log_weights)
        chunks.append((states[:, :enough], log_weights[:enough]))
        if enough is not None:
            break
        drawn += count
    return np.concatenate([s for s, _ in chunks], axis=1), np.concatenate([w for _, w in chunks])
