"""n: the first for which Σ p(z_t | x_t^(i)) over i = 1 … n passes a threshold  [Fox99, adaptive
sample set sizes].
"""

from dataclasses import dataclass

import numpy as np

from mcloc.protocols import Counter
from mcloc.registry import param
from mcloc.sample_size.adaptive import Adaptive
from mcloc.statespace import LogWeights, States, StateSpace


@dataclass(frozen=True)
class LikelihoodSum(Adaptive):
    """Draw until the sum of the weights, before normalization, passes a threshold [Fox99].

    A prediction that is well in tune with the scan makes every weight large and the set small; a
    scan that surprises makes it large. Weights are relative to a scan that the map explains
    perfectly, at most 1: the threshold is the size of the set in that best of cases. A set that no
    scan has weighed yet weighs nothing, and is as large as may be.
    """

    # On recorded office logs 100 takes 2,000 to 3,000 particles in the median, as KLD does.
    threshold: float = param(100.0, "", "sum of the weights to pass", above=0, high=1e7)

    def counter(self, space: StateSpace, step: int, nth: int) -> Counter:
        return _SumCounter(self)


class _SumCounter:
    def __init__(self, rule: LikelihoodSum) -> None:
        self.rule, self.drawn, self.sum = rule, 0, 0.0

    def enough(self, states: States, log_weights: LogWeights) -> int | None:
        # One after the other, from the sum so far on: rounded alike whatever the chunk.
        sums = np.cumsum(np.concatenate([[self.sum], np.exp(log_weights)]))[1:]
        numbers = self.drawn + 1 + np.arange(len(sums))
        full = (sums > self.rule.threshold) & (numbers >= self.rule.minimum)
        met = np.flatnonzero(full | (numbers >= self.rule.maximum))
        self.drawn, self.sum = self.drawn + len(sums), float(sums[-1])
        return int(met[0]) + 1 if len(met) else None
