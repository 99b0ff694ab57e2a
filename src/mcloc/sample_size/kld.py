"""n ≥ (k − 1)/(2ε) · (1 − 2/(9(k − 1)) + √(2/(9(k − 1))) z_{1−δ})³ for k occupied bins  [Fox:
Adapting the sample size in particle filters through KLD-sampling, IJRR 2003].
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from mcloc.kernels.bins import BinCounter
from mcloc.protocols import Counter
from mcloc.registry import param
from mcloc.sample_size.adaptive import Adaptive
from mcloc.statespace import LogWeights, States, StateSpace


@dataclass(frozen=True)
class KLD(Adaptive):
    """KLD-sampling [Fox: Adapting the sample size in particle filters through KLD-sampling, IJRR
    2003].

    Draws until, with probability 1 − δ, the Kullback–Leibler distance between the sample set and
    the true predictive density over the occupied bins is below ε.
    """

    epsilon: float = param(0.02, "", "bound on the Kullback-Leibler distance", above=0, high=1)
    delta: float = param(0.01, "", "chance of missing that bound", above=0, high=0.5)
    bin_length: float = param(0.5, "m", "side of a bin along a straight axis", above=0)
    bin_angle: float = param(
        0.26, "rad", "side of a bin along a circular axis", above=0, high=np.pi
    )

    def counter(self, space: StateSpace, step: int, nth: int) -> Counter:
        sides = [self.bin_angle if circular else self.bin_length for circular in space.circular]
        return _KLDCounter(self, np.array(sides))

    def bound(self, bins: int) -> float:
        """How many particles k occupied bins ask for."""
        if bins <= 1:
            return 1.0
        a = 2.0 / (9.0 * (bins - 1))
        z = float(ndtri(1.0 - self.delta))
        return float((bins - 1) / (2.0 * self.epsilon) * (1.0 - a + np.sqrt(a) * z) ** 3)


class _KLDCounter:
    def __init__(self, rule: KLD, sides: np.ndarray) -> None:
        self.rule, self.drawn = rule, 0
        self.bins = BinCounter(sides)

    def enough(self, states: States, log_weights: LogWeights) -> int | None:
        lowest, highest = self.rule.minimum, self.rule.maximum
        occupied = self.bins.add(states)
        numbers = self.drawn + 1 + np.arange(states.shape[1])
        wanted = np.clip(self._bounds(occupied), lowest, highest)
        met = np.flatnonzero(numbers >= wanted)
        self.drawn += states.shape[1]
        return int(met[0]) + 1 if len(met) else None

    def _bounds(self, occupied: np.ndarray) -> np.ndarray:
        """`bound` for each number of bins; they are few and repeat."""
        distinct, where = np.unique(occupied, return_inverse=True)
        return np.array([self.rule.bound(int(k)) for k in distinct])[where]
