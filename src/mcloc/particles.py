"""Particles: Bel(x) = {x^(i), p^(i)}, i = 1 … N  [Fox01 §19.2.3]."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import FilterError
from mcloc.statespace import LogWeights, States


@dataclass(frozen=True, eq=False)
class Particles:
    """A weighted sample set. states: (D, N). log_weights: (N,), normalized: their exponentials sum
    to 1.

    Make one with `normalized`, the one place where weights are normalized.
    """

    states: States
    log_weights: LogWeights

    @classmethod
    def normalized(cls, states: States, log_weights: LogWeights) -> "Particles":
        """Particles whose weights sum to 1. Raises FilterError on NaN, or where every weight is
        0.
        """
        total = log_sum_exp(log_weights)
        if not np.isfinite(total):
            raise FilterError(
                f"the {len(log_weights)} weights sum to {np.exp(total)}, not to a finite number > 0"
            )
        return cls(np.ascontiguousarray(states), log_weights - total)

    @classmethod
    def equal(cls, states: States) -> "Particles":
        """Particles that all weigh the same."""
        n = states.shape[1]
        if n == 0:
            raise FilterError("a sample set needs at least one particle")
        return cls(np.ascontiguousarray(states), np.full(n, -np.log(n)))

    def __len__(self) -> int:
        return int(self.states.shape[1])

    @cached_property
    def weights(self) -> NDArray[np.float64]:
        """(N,): sum to 1."""
        w: NDArray[np.float64] = np.exp(self.log_weights)
        w /= w.sum()
        return w

    @cached_property
    def ess(self) -> float:
        """Effective sample size 1 / Σ w², from 1 to N."""
        return float(1.0 / np.sum(self.weights**2))


def log_sum_exp(log_weights: LogWeights) -> float:
    """log Σ exp, −inf for no weight at all. Raises FilterError on NaN."""
    if len(log_weights) == 0:
        return -np.inf
    top = log_weights.max()
    if np.isnan(top):
        raise FilterError("a weight is NaN")
    if np.isposinf(top):
        raise FilterError("a weight is infinite")
    if np.isneginf(top):
        return -np.inf
    return float(top + np.log(np.exp(log_weights - top).sum()))
