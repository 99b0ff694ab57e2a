"""A share of random particles, which skip resampling and moving and are weighed like all others
[Est §4, point 4].
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mcloc.draws import Draws, Stream
from mcloc.proposals.target import Target
from mcloc.protocols import Source, Weighed


class Proposal(Protocol):
    """As in `filters/particle_filter.py`."""

    def prepare(self, target: Target, n: int | None, draws: Draws) -> tuple[Source, int | None]:
        """A source of weighted particles, and how many it has."""


@dataclass(frozen=True, slots=True)
class Renewed:
    """Of n particles of another proposal share · n, rounded up or down by chance, are drawn from
    U(x) instead: the dynamics are (1 − share) p_d + share U, in strata.
    """

    proposal: Proposal
    share: float

    def prepare(self, target: Target, n: int | None, draws: Draws) -> tuple[Source, int | None]:
        """The source of weighted particles, and how many it has (None: as many as asked for)."""
        others, count = self.proposal.prepare(target, n, draws)
        offset = float(draws.uniform(Stream.CHOICE, 0, 1)[2, 0])

        def source(first: int, count: int) -> Weighed:
            drawn = others(first, count)
            passed = np.floor(offset + self.share * np.arange(first, first + count + 1))
            random = np.flatnonzero(np.diff(passed))
            if len(random) == 0:
                return drawn
            x = target.environment.sample(draws, int(passed[0]), len(random))
            for whole, part in zip(
                drawn,
                (x, target.environment.log_prior(x), target.sensor.log_likelihood(x, target.z)),
                strict=True,
            ):
                whole[..., random] = part
            return drawn

        return source, count
