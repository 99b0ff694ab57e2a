"""q = p(x_t | u_t, x_{t−1}) Bel(x_{t−1}),  w = p(z_t | x_t)  [Fox01 Eq. 19.2.4, 19.2.6]."""

from dataclasses import dataclass

import numpy as np

from mcloc.draws import Draws
from mcloc.proposals.target import Target
from mcloc.protocols import Source, Weighed
from mcloc.resampling import Resampler


@dataclass(frozen=True, slots=True)
class Forward:
    """Draw an ancestor, move it, weigh it by the measurement: the proposal of MCL."""

    resampler: Resampler

    def prepare(self, target: Target, n: int | None, draws: Draws) -> tuple[Source, int | None]:
        """The source of weighted particles, and how many it has (None: as many as asked for).

        n: how many are wanted, None where that is found while drawing. A set that is kept instead
        of resampled has as many particles as before, and each brings N times its weight along.
        """
        ancestry = self.resampler(target.particles, n, draws)

        def source(first: int, count: int) -> Weighed:
            ancestors = ancestry.of(first, count)
            states = target.sample_predictive(ancestors, draws, first)
            before = target.environment.log_prior(states)
            if ancestry.log_weights is not None:
                before = before + ancestry.log_weights[ancestors] + np.log(len(target.particles))
            return Weighed(states, before, target.sensor.log_likelihood(states, target.z))

        return source, ancestry.n
