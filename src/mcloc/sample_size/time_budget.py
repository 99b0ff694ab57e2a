"""n: as many as can be drawn and weighed in the time that is allowed, an any-time filter  [Fox01
§19.1].
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter

from mcloc.protocols import Counter
from mcloc.registry import param
from mcloc.sample_size.adaptive import Adaptive
from mcloc.statespace import LogWeights, States, StateSpace


@dataclass(frozen=True)
class TimeBudget(Adaptive):
    """As many particles as the time allows [Fox01 §19.1].

    The clock is read after each chunk of particles, which the set keeps as a whole, so the budget
    is passed by the time of one chunk, at most a quarter of the set. It is that of one sample set:
    a step that is drawn again has it twice. No two runs are alike; `Recorded` repeats one by the
    sizes that it noted.
    """

    budget: float = param(0.05, "s", "time to draw and weigh a sample set", above=0, high=3600)
    clock: Callable[[], float] = field(default=perf_counter, repr=False)

    def counter(self, space: StateSpace, step: int, nth: int) -> Counter:
        return _TimeCounter(self)


class _TimeCounter:
    def __init__(self, rule: TimeBudget) -> None:
        self.rule, self.drawn, self.until = rule, 0, rule.clock() + rule.budget

    def enough(self, states: States, log_weights: LogWeights) -> int | None:
        n = len(log_weights)
        self.drawn += n
        if self.drawn >= self.rule.maximum:
            return n - (self.drawn - self.rule.maximum)
        return n if self.drawn >= self.rule.minimum and self.rule.clock() >= self.until else None
