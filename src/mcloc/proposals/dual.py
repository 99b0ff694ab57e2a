"""q̄ = p(z_t | x_t) / π(z_t),  w = p(z_t | x_t) p(x_t | d_{0…t−1}, u_t) / q̄(x_t): poses from the
measurement, weighed by the belief  [Fox01 §19.3.2, Eq. 19.3.7, 19.3.8].
"""

from dataclasses import dataclass

from mcloc.draws import Draws
from mcloc.proposals.predictive import Way, predictive
from mcloc.proposals.target import Target
from mcloc.protocols import PoseSampler, Source, Weighed

LOOKING, WEIGHING = 1 << 16, 2 << 16
"""Added to the number of the part, for the random numbers that are used beside those of the poses:
by the sampler when it is given the measurement, and by the way to weigh. Any of the three may draw
from any stream; a filter has fewer than 2¹⁶ parts.
"""


@dataclass(frozen=True, slots=True)
class Dual:
    """Draw poses from the measurement, and weigh them by what was believed, in one of the ways of
    `proposals/predictive.py`.

    q̄ may be any density that is positive wherever a robot can be: a pose is weighed by the filter's
    own p(z | x) over q̄, and where q̄ is p(z | x) / π(z) that leaves the papers' weights. Poses that
    nobody believed in have weight α U; after a kidnapping that is all they have.
    """

    sampler: PoseSampler
    way: Way

    def prepare(self, target: Target, n: int | None, draws: Draws) -> tuple[Source, int | None]:
        """The source of weighted particles, and how many it has (None: as many as asked for)."""
        q = self.sampler.given(target.z, draws.of_part(draws.part + LOOKING))
        believed = predictive(self.way, target, draws.of_part(draws.part + WEIGHING))

        def source(first: int, count: int) -> Weighed:
            x = q.sample(draws, first, count)
            before = target.environment.log_prior(x) + believed(x, first) - q.log_density(x)
            return Weighed(x, before, target.sensor.log_likelihood(x, target.z))

        return source, n
