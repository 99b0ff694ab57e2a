"""Resampling: x_{t−1}^(j) drawn from Bel(x_{t−1}) by its weights  [Fox01 §19.2.3 (i)].

A resampler says which particle of the old set is the ancestor of the j-th new one. Each returns an
`Ancestry`: asked for the new particles first … first + n − 1 it gives their ancestors, whatever the
chunk.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws, Stream
from mcloc.particles import Particles
from mcloc.registry import Configurable, Registry, param
from mcloc.statespace import LogWeights

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


@dataclass(frozen=True, slots=True)
class Ancestry:
    """Who descends from whom.

    of(first, n) -> (n,) indices into the old set. n: how many new particles there are, or None for
    as many as are asked for. log_weights: (N,) of the old set, carried over where the set was kept,
    else None.
    """

    of: Callable[[int, int], NDArray[np.intp]]
    n: int | None
    log_weights: LogWeights | None = None


class Resampler(Protocol):
    """Draws ancestors in proportion to the weights. n: how many, None where that is not known
    yet.
    """

    def __call__(self, particles: Particles, n: int | None, draws: Draws) -> Ancestry: ...


@dataclass(frozen=True)
class Systematic(Configurable):
    """One random offset and a regular comb over the cumulative weights.

    A sample set whose size is found while drawing cannot use a comb of n teeth: cut short it covers
    only the first part of the weights. Its teeth come in the golden-ratio order instead, u_j =
    frac(u_0 + j (√5 − 1)/2): each u_j is uniform and every prefix is spread nearly as evenly as a
    comb [Kuipers, Niederreiter: Uniform distribution of sequences, ch. 2 §3].
    """

    def __call__(self, particles: Particles, n: int | None, draws: Draws) -> Ancestry:
        cumulative = np.cumsum(particles.weights)
        offset = float(draws.uniform(Stream.ANCESTOR, 0, 1)[0, 0])

        def of(first: int, count: int) -> NDArray[np.intp]:
            j = np.arange(first, first + count, dtype=np.float64)
            teeth = np.mod(offset + j * GOLDEN, 1.0) if n is None else (offset + j) / n
            found = np.searchsorted(cumulative, teeth * cumulative[-1], side="right")
            ancestors: NDArray[np.intp] = np.minimum(found, len(cumulative) - 1)
            return ancestors

        return Ancestry(of, n)


@dataclass(frozen=True)
class Selective(Configurable):
    """Resample only when the effective sample size is below a share of the set, else keep the set
    and its size.
    """

    ess_below: float = param(0.5, "", "resample only where ESS / N is below", above=0, high=1)
    resampler: Resampler = field(default_factory=Systematic)

    def __call__(self, particles: Particles, n: int | None, draws: Draws) -> Ancestry:
        size = len(particles)
        if particles.ess < self.ess_below * size:
            return self.resampler(particles, n, draws)
        return Ancestry(
            lambda first, count: np.arange(first, first + count), size, particles.log_weights
        )


def when_ess_below(share: float, resampler: Resampler) -> Resampler:
    """`resampler`, but only when ESS < share · N."""
    return Selective(share, resampler)


RESAMPLERS: Registry[Resampler] = Registry(
    "resampler", {"systematic": Systematic, "selective": Selective}
)
