"""n = Σ n_k, n_k ~ Binomial(n, φ_k): a fixed number of particles, divided among parts anew at each
step.
"""

from dataclasses import dataclass

import numpy as np

from mcloc.protocols import Counter
from mcloc.registry import Configurable, param
from mcloc.sample_size.fixed import Until
from mcloc.statespace import StateSpace


@dataclass(frozen=True)
class Split(Configurable):
    """A share φ of `particles`, or the rest of them; each particle falls to one or the other by
    chance, which is the same in every run.
    """

    particles: int = param(5000, "", "particles of both parts", low=2, high=1e7)
    phi: float = param(0.1, "", "share of the one part", above=0, high=0.99)
    rest: bool = param(False, "", "whether it is that of the other part")

    @property
    def fixed(self) -> int | None:
        return None

    def counter(self, space: StateSpace, step: int, nth: int) -> Counter:
        # Each part needs one at least, and both have to draw the same number.
        share = np.random.default_rng([step, self.particles]).binomial(self.particles, self.phi)
        share = int(np.clip(share, 1, self.particles - 1))
        return Until(self.particles - share if self.rest else share)
