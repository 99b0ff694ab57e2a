"""U(x) over a region."""

from dataclasses import dataclass

import numpy as np

from mcloc.draws import Draws, Stream
from mcloc.filters.hierarchical.domain import Domain
from mcloc.filters.hierarchical.region import Region
from mcloc.sensors.low_resolution import LEAST
from mcloc.statespace import LogWeights, States


@dataclass(frozen=True, eq=False)
class Places:
    """A part of a domain as an environment of its own."""

    domain: Domain
    part: Region

    def sample(self, draws: Draws, first: int, n: int) -> States:
        """(D, n): the particles first … first + n − 1."""
        dimension = self.part.space.dimension
        calls = -(-dimension // 4)  # which give four numbers each
        u = draws.uniform(Stream.RANDOM_POSE, calls * first, calls * n)
        u = u.reshape(4, n, calls).transpose(0, 2, 1).reshape(4 * calls, n)
        return self.domain.states(self.part, np.ascontiguousarray(u[:dimension]))

    def log_density(self, x: States) -> LogWeights:
        """(n,): that of the whole domain; a node's parts are weighed by p(z | x) alone."""
        return self.domain.environment.log_density(x)

    def log_prior(self, x: States) -> LogWeights:
        """(n,): log p(x | m), p never quite 0: a node may have nothing but impossible states."""
        prior: LogWeights = np.maximum(self.domain.environment.log_prior(x), LEAST)
        return prior
