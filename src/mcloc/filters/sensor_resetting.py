"""Sensor resetting: where a scan fits too badly, a share of the particles is replaced by poses from
that scan  [Lenser, Veloso: Sensor resetting localization for poorly modelled mobile robots, ICRA
2000].
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mcloc.draws import Draws
from mcloc.events.measured import is_own
from mcloc.filters.filter import StepInfo
from mcloc.filters.particle_filter import ParticleBelief, ParticleFilter
from mcloc.filters.recovery import Augmented, Evidence, Recovery
from mcloc.particles import Particles
from mcloc.proposals.dual import LOOKING
from mcloc.protocols import PoseSampler
from mcloc.resampling import Systematic

RESETS = 1 << 8  # added to the number of the part; a filter has fewer parts


@dataclass(frozen=True, kw_only=True)
class SensorResetting(ParticleFilter):
    """MCL, and after each step a share α of the belief is drawn from p(z | x)/π(z) instead.

    resetting: says how large α is; in the paper it is 1 − likelihood / threshold of this very scan,
    which is Augmented with rate_fast = 1. What is drawn has equal weights: where the scan fits two
    places, both get their share, whatever was believed before.
    """

    sampler: PoseSampler
    resetting: Recovery = field(default_factory=Augmented)

    def step(
        self, bel: ParticleBelief, u: Any, z: Any, draws: Draws
    ) -> tuple[ParticleBelief, StepInfo]:
        """As of any particle filter."""
        after, info = super().step(bel, u, z, draws)
        alpha = self.resetting.alpha(info.evidence) if is_own(z) else 0.0
        if alpha == 0.0 or bel.uniform:
            return after, info
        n = max(round(alpha * info.n), 1)
        own = draws.of_part(RESETS)
        found = self.sampler.given(z, draws.of_part(LOOKING))
        kept = Systematic()(after.particles, info.n - n, own).of(0, info.n - n)
        states = np.take(after.particles.states, kept, axis=1)
        particles = Particles.equal(np.concatenate([states, found.sample(own, 0, n)], axis=1))
        info = replace(info, ess=particles.ess, alpha=alpha)
        searching = after.searching or alpha > self.resetting.alpha(Evidence())
        return replace(after, particles=particles, searching=searching), info
