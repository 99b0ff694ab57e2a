"""n ≥ (k − 1)/(2ε) · (1 − 2/(9(k − 1)) + √(2/(9(k − 1))) z_{1−δ})³ for k occupied bins  [Fox:
Adapting the sample size in particle filters through KLD-sampling, IJRR 2003].
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from mcloc.kernels.bins import Bins, first_enough
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
        return float(self.bounds(np.array([bins]))[0])

    def bounds(self, bins: NDArray[np.int64]) -> NDArray[np.float64]:
        """`bound` for each number of bins."""
        more = np.maximum(bins - 1.0, 1.0)
        a = 2.0 / (9.0 * more)
        z = float(ndtri(1.0 - self.delta))
        wanted = more / (2.0 * self.epsilon) * (1.0 - a + np.sqrt(a) * z) ** 3
        return np.where(bins <= 1, 1.0, wanted)


class _KLDCounter:
    def __init__(self, rule: KLD, sides: NDArray[np.float64]) -> None:
        self.rule, self.drawn = rule, 0
        self.bins = Bins(sides, np.zeros(len(sides)))

    def enough(self, states: States, log_weights: LogWeights) -> int | None:
        before, drawn = self.bins.known, self.drawn
        # Numbered as they are found, so a number tells how many bins there were before.
        labels = self.bins.add(states)
        asked = self.rule.bounds(np.arange(before, self.bins.known + 1))
        least = np.clip(asked, self.rule.minimum, self.rule.maximum)
        self.drawn += states.shape[1]
        met = first_enough(labels, before, drawn, least)
        return None if met < 0 else met + 1
