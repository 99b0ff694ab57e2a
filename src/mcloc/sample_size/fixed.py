"""The same number of particles at every step."""

from dataclasses import dataclass

from mcloc.protocols import Counter
from mcloc.registry import Configurable, param
from mcloc.statespace import LogWeights, States, StateSpace


@dataclass(frozen=True)
class Fixed(Configurable):
    """Always n particles."""

    particles: int = param(5000, "", "number of particles", low=1, high=1e7)

    @property
    def fixed(self) -> int | None:
        return self.particles

    def counter(self, space: StateSpace, step: int, nth: int) -> Counter:
        return Until(self.particles)


class Until:
    """Counts to n."""

    def __init__(self, n: int) -> None:
        self.missing = n

    def enough(self, states: States, log_weights: LogWeights) -> int | None:
        if states.shape[1] >= self.missing:
            return self.missing
        self.missing -= states.shape[1]
        return None
