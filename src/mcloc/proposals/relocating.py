"""p(z | x) [(1 − α) p(x | d_{0…t−1}, u) + α U(x)]: each term is drawn in a way of its own, with
w = p(z | x) (1 − α)/(1 − φ) and w = p(z | x) α U(x) / (φ q̄(x))  [the mixture of Fox01 §19.3.3, for
the dynamics of Yee Eq. 1].
"""

import math
from dataclasses import dataclass, field

import numpy as np

from mcloc.draws import Draws, Stream
from mcloc.proposals.dual import LOOKING
from mcloc.proposals.forward import Forward
from mcloc.proposals.target import Target
from mcloc.protocols import PoseSampler, Source, Weighed
from mcloc.resampling import Resampler, Systematic, Tempered


@dataclass(frozen=True)
class Relocating:
    """What MCL draws; and while the filter searches, poses from the measurement for a robot that
    may be anywhere.

    A filter searches from a uniform start, or from when it found itself lost, until it is sure of
    one place. Then U, the part of the dynamics in which the robot is anywhere, is not left to
    random particles, which hardly ever meet a place that fits, but drawn from q̄: a share φ of the
    particles, all of them while nothing is known. Their weights are exact, whatever q̄ is like: an
    alias is believed no more than it deserves, and no density of what was believed is needed.

    Most robots that seem lost are not: people stand around them. So the α of a step is that which
    recovery asks for, but `carried_off` at most. The scans decide, not one of them but several.
    Meanwhile the set has `particles`, whatever its size asks for, and `keeping` keeps places that
    are unlikely for now. Of a robot that is localized this draws what MCL does, to the last bit,
    unless recovery asks for random particles all the time.
    """

    sampler: PoseSampler
    resampler: Resampler = field(default_factory=Systematic)
    phi: float = 0.5
    particles: int = 5000
    carried_off: float = 0.01
    keeping: Resampler = field(default_factory=Tempered)

    def prepare(self, target: Target, n: int | None, draws: Draws) -> tuple[Source, int | None]:
        """The source of weighted particles, and how many it has (None: as many as asked for)."""
        if target.alpha == 0.0 and not target.uniform:
            if not target.searching:
                return Forward(self.resampler).prepare(target, n, draws)
            return Forward(self.keeping).prepare(target, self.particles, draws)
        found = self.sampler.given(target.z, draws.of_part(draws.part + LOOKING))
        ancestry = self.keeping(target.particles, self.particles, draws)
        moving = np.zeros(len(target.particles))
        if ancestry.log_weights is not None:
            moving = ancestry.log_weights + math.log(len(target.particles))
        alpha, phi = 1.0, 1.0
        if not target.uniform:
            alpha, phi = min(target.alpha, self.carried_off), self.phi
            moving += math.log1p(-alpha) - math.log1p(-phi)

        def source(first: int, count: int) -> Weighed:
            ancestors = ancestry.of(first, count)
            states = target.sample_moved(ancestors, draws, first)
            before = moving[ancestors]
            jumps = draws.uniform(Stream.PROPOSAL, first, count)[0] < phi
            x = np.ascontiguousarray(found.sample(draws, first, count)[:, jumps])
            states[:, jumps] = x
            weight, q = target.environment.log_density(x), found.log_density(x)
            # Where nobody can be, q̄ may be 0 as well: at the edge of a cell, by rounding.
            np.subtract(weight, q, out=weight, where=weight > -np.inf)
            before[jumps] = math.log(alpha / phi) + weight
            before += target.environment.log_prior(states)
            return Weighed(states, before, target.sensor.log_likelihood(states, target.z))

        return source, self.particles
