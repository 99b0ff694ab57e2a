"""A filter is a tuple of parts φ_k, q_k, N_k; one step draws, weighs and normalizes  [Fox01
§19.2.3, §19.3.3].
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from mcloc.draws import Draws
from mcloc.estimate import Hypothesis, away, hypotheses
from mcloc.events.measured import is_conclusive, is_own
from mcloc.filters.drawing import draw
from mcloc.filters.filter import StepInfo
from mcloc.filters.people import NoPeopleFilter
from mcloc.filters.recovery import LITTLE, Evidence, NoRandomParticles, Recovery
from mcloc.particles import Particles, log_sum_exp, log_sums_exp
from mcloc.proposals.target import Target
from mcloc.protocols import (
    Density,
    Environment,
    MotionModel,
    PeopleFilter,
    Predictive,
    SampleSize,
    SensorModel,
    Source,
    Weighed,
)
from mcloc.resampling import Systematic
from mcloc.statespace import SE2, StateSpace
from mcloc.storage import Arrays

LEAST = 1e-6  # of the belief


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
class ParticleBelief:
    """What a particle filter carries from step to step.

    evidence: by sensor; nothing is learned of what is usual while more than LITTLE of the belief
    is not in one place. uniform: whether it is still that of a robot of which nothing is known.
    searching: whether the filter is not sure of the place: from a uniform start, or from when it
    found itself lost, until all but LEAST of the belief is in one place.
    """

    particles: Particles
    evidence: Mapping[str, Evidence] = field(default_factory=dict)
    uniform: bool = False
    searching: bool = False


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
    people: PeopleFilter = field(default_factory=NoPeopleFilter)
    anywhere: SampleSize | None = None

    def start(self, initial: Density, draws: Draws) -> ParticleBelief:
        """Particles drawn from an initial density, as many as the first part's size asks for;
        `anywhere`, if given, says how many where that density is the environment.
        """

        def source(first: int, n: int) -> Weighed:
            # No scan has weighed them yet.
            return Weighed(initial.sample(draws, first, n), np.zeros(n), np.full(n, -np.inf))

        uniform = initial is self.environment
        size = self.anywhere if uniform and self.anywhere is not None else self.parts[0].size
        counter = size.counter(self.space, draws.step, 0)
        particles = Particles.equal(draw(source, counter, size.fixed, None).states)
        return ParticleBelief(particles, uniform=uniform, searching=uniform)

    def step(
        self, bel: ParticleBelief, u: Any, z: Any, draws: Draws
    ) -> tuple[ParticleBelief, StepInfo]:
        """The belief after moving by u and measuring z. Raises FilterError where every weight is 0.

        A scan that is explained much worse than usual makes the step be drawn once more, with doubt
        in the wheels.
        """
        source = self.sensor.source(z)
        evidence = bel.evidence.get(source, Evidence())
        # What others tell is no sign that the robot is lost: it is they who may be. But one that is
        # lost by its own sensors may well be where they say.
        judged = (evidence,) if is_own(z) else bel.evidence.values()
        alpha = max((self.recovery.alpha(e) for e in judged), default=0.0)
        searching = bel.searching or alpha > self.recovery.alpha(Evidence())
        filtered = 0.0
        if not searching:  # a filter that may be lost must see all that contradicts it
            z, filtered = self.people.without_people(z, self._predictive(bel, u, draws))
        sizes: list[int] = []
        drawn = self._draw(bel, u, z, alpha, 0.0, draws, sizes)
        total, likelihood = self._totals(drawn[0], z, filtered)
        doubt = self.recovery.doubt(evidence, likelihood) if is_conclusive(z) else 0.0
        if doubt > 0.0:
            drawn = self._draw(bel, u, z, alpha, doubt, draws, sizes)
            total, likelihood = self._totals(drawn[0], z, filtered)
        totals = [total, *(log_sum_exp(d.log_weights) for d in drawn[1:])]
        estimates = [t - math.log(len(d.log_before)) for t, d in zip(totals, drawn, strict=True)]
        if len(drawn) == 1:
            particles = Particles.normalized(drawn[0].states, drawn[0].log_weights, totals[0])
        else:
            shifts = self._shifts(estimates, [len(d.log_before) for d in drawn])
            particles = Particles.normalized(
                np.concatenate([d.states for d in drawn], axis=1),
                np.concatenate([d.log_weights + s for d, s in zip(drawn, shifts, strict=True)]),
            )
        readings = self.sensor.readings(z)
        elsewhere = away(particles, self.space) if searching else 0.0
        evidence = evidence.updated(likelihood, readings, self.recovery.rates, elsewhere <= LITTLE)
        searching = elsewhere > LEAST
        info = StepInfo(
            n=len(particles),
            ess=particles.ess,
            log_evidence=estimates[0],
            evidence=evidence,
            weighed=sum(sizes),
            alpha=alpha,
            doubt=doubt,
            sizes=tuple(sizes),
            filtered=filtered,
        )
        found = {**bel.evidence, source: evidence} if is_own(z) else bel.evidence
        return ParticleBelief(particles, found, searching=searching), info

    def hypotheses(self, bel: ParticleBelief) -> tuple[Hypothesis, ...]:
        """The modes of the sample set, most likely first; at least one."""
        return hypotheses(bel.particles, self.space)

    def adopted(self, bel: ParticleBelief) -> ParticleBelief:
        """The same particles: they know no map."""
        return replace(bel, evidence={})

    def packed(self, bel: ParticleBelief) -> tuple[dict[str, Any], Arrays]:
        """The belief but for its evidence, as what JSON knows and as arrays."""
        arrays = {"states": bel.particles.states, "log_weights": bel.particles.log_weights}
        return {"uniform": bel.uniform, "searching": bel.searching}, arrays

    def unpacked(
        self, values: dict[str, Any], arrays: Arrays, evidence: dict[str, Evidence]
    ) -> ParticleBelief:
        """The belief that `packed` describes."""
        particles = Particles(arrays["states"], arrays["log_weights"])
        return ParticleBelief(particles, evidence, values["uniform"], values["searching"])

    def _predictive(self, bel: ParticleBelief, u: Any, draws: Draws) -> Predictive:
        """Particles for looking at a measurement beforehand, with random numbers of their own.

        Neither random particles nor doubted moves are among them: what is taken for people is
        judged by what the filter believes, not by what it holds possible.
        """

        def sample(n: int) -> Particles:
            own = draws.of_part(draws.part + len(self.parts))
            ancestors = Systematic()(bel.particles, n, own).of(0, n)
            old = np.take(bel.particles.states, ancestors, axis=1)
            states = self.motion.sample(old, u, own, 0)
            return Particles.normalized(states, self.environment.log_prior(states))

        return sample

    def _draw(
        self,
        bel: ParticleBelief,
        u: Any,
        z: Any,
        alpha: float,
        doubt: float,
        draws: Draws,
        sizes: list[int],
    ) -> list[Weighed]:
        """The particles of every part; how many they are is added to `sizes`."""
        models = self.motion, self.sensor, self.environment
        known = bel.uniform, bel.searching
        target = Target(bel.particles, u, z, alpha, doubt, *models, *known)
        drawn = []
        for k, part in enumerate(self.parts):
            source, n = part.proposal.prepare(
                target, part.size.fixed, draws.of_part(draws.part + k)
            )
            counter = part.size.counter(self.space, draws.step, len(sizes))
            drawn.append(draw(source, counter, part.size.fixed, n))
            sizes.append(len(drawn[-1].log_before))
        return drawn

    def _totals(self, drawn: Weighed, z: Any, filtered: float) -> tuple[float, float]:
        """Log of the sum of all weights; and the mean of p(z | x)^(1/readings) over the predictive
        density, the likelihood of one reading.

        Of one, so that scans of any length and novelty compare. Readings that were left out count
        as explained by nothing: or a lost filter would take what contradicts it for people, and be
        content with the rest.
        """
        of_one = 1.0 / self.sensor.readings(z)
        before, total, likelihood = log_sums_exp(
            drawn.log_before, drawn.log_likelihoods, 0.0, 1.0, of_one
        )
        if not math.isfinite(before):
            return total, 0.0
        return total, (1.0 - filtered) * math.exp(likelihood - before)

    def _shifts(self, estimates: list[float], sizes: list[int]) -> list[float]:
        """What to add to the log weights of each part for its share of the belief.

        Within a group a particle of part k weighs φ_k / N_k; then each group is brought to its
        share Σ φ.
        """
        phis = np.array([part.phi for part in self.parts])
        evidence = np.log(phis) + np.array(estimates)
        shifts = np.log(phis) - np.log(sizes)
        for group in {part.group for part in self.parts}:
            members = np.array([part.group == group for part in self.parts])
            total = np.logaddexp.reduce(evidence[members])
            if np.isfinite(total):
                shifts[members] += np.log(phis[members].sum()) - total
        return [float(shift) for shift in shifts]
