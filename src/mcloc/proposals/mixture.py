"""q = (1 − φ) p(x_t | d_{0…t−1}, u) + φ q̄(x_t),  w = p(z | x_t) p(x_t | d_{0…t−1}, u) / q: forward
and dual particles under one density  [Fox01 Eq. 19.3.16; the balance heuristic of Veach, Guibas:
SIGGRAPH 1995].
"""

import math
from dataclasses import dataclass, field

import numpy as np

from mcloc.draws import Draws, Stream
from mcloc.proposals.dual import LOOKING, WEIGHING
from mcloc.proposals.forward import Forward
from mcloc.proposals.predictive import ForwardTree, Way, predictive
from mcloc.proposals.target import Target
from mcloc.protocols import PoseSampler, Source, Weighed
from mcloc.resampling import Resampler, Systematic


@dataclass(frozen=True)
class Mixture:
    """Draw a share φ from the measurement while the filter searches; else what MCL draws.

    It searches from a uniform start on, until the first scan, and whenever its dynamics hold random
    particles (α > 0): those are then looked for where the scan says, instead of anywhere. Each
    particle is weighed by the density of the whole mixture, whichever of the two it was drawn from:
    where q̄ proposes an alias of the true place, the weight there is what it would be without, and
    far from everything that q̄ proposes it is that of MCL. The way has to give a density: pairs
    (approach 1) give a number whose mean is one. A robot that is localized pays for none of this.
    """

    sampler: PoseSampler
    resampler: Resampler
    phi: float = 0.5
    way: Way = field(default_factory=ForwardTree)

    def prepare(self, target: Target, n: int | None, draws: Draws) -> tuple[Source, int | None]:
        """The source of weighted particles, and how many it has (None: as many as asked for)."""
        if target.alpha == 0.0 and not target.uniform:
            return Forward(self.resampler).prepare(target, n, draws)
        ancestry = Systematic()(target.particles, n, draws)
        found = self.sampler.given(target.z, draws.of_part(draws.part + LOOKING))
        believed = predictive(self.way, target, draws.of_part(draws.part + WEIGHING))
        log_dual, log_forward = math.log(self.phi), math.log1p(-self.phi)

        def source(first: int, count: int) -> Weighed:
            forward = target.sample_predictive(ancestry.of(first, count), draws, first)
            dual = found.sample(draws, first, count)
            chosen = draws.uniform(Stream.PROPOSAL, first, count)[0] < self.phi
            states = np.where(chosen, dual, forward)
            predicted = believed(states, first)
            q = np.logaddexp(log_forward + predicted, log_dual + found.log_density(states))
            # Where nothing is predicted nothing is drawn but by q̄, and then q is not 0.
            weight = np.subtract(predicted, q, out=predicted, where=predicted > -np.inf)
            before = weight + target.environment.log_prior(states)
            return Weighed(states, before, target.sensor.log_likelihood(states, target.z))

        return source, ancestry.n
