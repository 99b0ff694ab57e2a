"""Particles: Bel(x) = {x^(i), p^(i)}, i = 1 … N  [Fox01 §19.2.3]."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import FilterError
from mcloc.kernels.weights import log_sums, weights
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
    def normalized(
        cls, states: States, log_weights: LogWeights, log_total: float | None = None
    ) -> "Particles":
        """Particles whose weights sum to 1. log_total: log Σ of the weights, where it is known.

        Raises FilterError on NaN, or where every weight is 0.
        """
        total = log_sum_exp(log_weights) if log_total is None else log_total
        if not math.isfinite(total):
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

    @property
    def weights(self) -> NDArray[np.float64]:
        """(N,): sum to 1."""
        return self._weights[0]

    @property
    def ess(self) -> float:
        """Effective sample size 1 / Σ w², from 1 to N."""
        return 1.0 / self._weights[1]

    @cached_property
    def _weights(self) -> tuple[NDArray[np.float64], float]:
        """The weights, and the sum of their squares."""
        w, total, squares = weights(self.log_weights)
        w /= total
        return w, squares / total**2


def log_sum_exp(log_weights: LogWeights) -> float:
    """log Σ exp, −inf for no weight at all. Raises FilterError on NaN."""
    return log_sums_exp(log_weights, log_weights, 0.0)[0]


def log_sums_exp(log_weights: LogWeights, more: LogWeights, *scales: float) -> list[float]:
    """log Σ exp(log_weights + scale · more) for each scale. Raises FilterError on NaN."""
    if len(log_weights) == 0:
        return [-math.inf] * len(scales)
    tops, totals = log_sums(log_weights, more, *scales)
    for top in tops.tolist():
        if math.isnan(top):
            raise FilterError("a weight is NaN")
        if top == math.inf:
            raise FilterError("a weight is infinite")
    listed: list[float] = totals.tolist()
    return listed
