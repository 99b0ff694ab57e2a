"""Resampling: x_{t−1}^(j) drawn from Bel(x_{t−1}) by its weights  [Fox01 §19.2.3 (i)].

A resampler says which particle of the old set is the ancestor of the j-th new one. Each returns an
`Ancestry`: asked for the new particles first … first + n − 1 it gives their ancestors, whatever the
chunk. Most lay teeth u_j in [0, 1) against the cumulative weights; they differ in how evenly the
teeth are spread.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws, Stream
from mcloc.errors import ConfigError
from mcloc.kernels.ancestors import ancestors_of, ancestors_of_golden_comb, first_above
from mcloc.particles import Particles
from mcloc.protocols import Indices
from mcloc.registry import Configurable, Registry, param
from mcloc.statespace import LogWeights


@dataclass(frozen=True, slots=True)
class Ancestry:
    """Who descends from whom.

    of(first, n) -> (n,) indices into the old set. n: how many new particles there are, or None for
    as many as are asked for. log_weights: (N,) what descendants of each of the old set bring along,
    where they were not drawn in proportion to its weights, or the set was kept: N times that is the
    factor of their weights. Else None.
    """

    of: Callable[[int, int], Indices]
    n: int | None
    log_weights: LogWeights | None = None


class Resampler(Protocol):
    """Draws ancestors in proportion to the weights."""

    @property
    def needs_n(self) -> bool:
        """Whether it can only draw a number that is known beforehand."""

    def __call__(self, particles: Particles, n: int | None, draws: Draws) -> Ancestry:
        """n: how many, None where that is found while drawing."""


def known_before(n: int | None) -> int:
    """n. Raises ConfigError where it is found while drawing."""
    if n is None:
        raise ConfigError(
            "this resampler must know beforehand how many particles are drawn: "
            "choose --size fixed, or another --resampler"
        )
    return n


@dataclass(frozen=True)
class Multinomial(Configurable):
    """Each ancestor by itself: independent uniform teeth."""

    needs_n: ClassVar[bool] = False

    def __call__(self, particles: Particles, n: int | None, draws: Draws) -> Ancestry:
        search = Search(particles.weights)
        return Ancestry(lambda first, count: search(_uniform(draws, first, count)), n)


@dataclass(frozen=True)
class Stratified(Configurable):
    """One uniform tooth in each of n strata of equal width.

    Where n is found while drawing, the strata are halved as the set grows: the first 2^k teeth lie
    one in each of 2^k strata, and so does every later 2^k of them, counted from a multiple of 2^k
    [Owen's scrambling of van der Corput's sequence: Randomly permuted (t, m, s)-nets and (t,
    s)-sequences, 1995]. A set of n teeth consists of as many such blocks as n has binary ones.
    """

    needs_n: ClassVar[bool] = False

    def __call__(self, particles: Particles, n: int | None, draws: Draws) -> Ancestry:
        search = Search(particles.weights)

        def of(first: int, count: int) -> Indices:
            if n is None:
                return search(_halving_teeth(draws, first + count)[first:])
            j = np.arange(first, first + count, dtype=np.float64)
            return search((j + _uniform(draws, first, count)) / n)

        return Ancestry(of, n)


@dataclass(frozen=True)
class Systematic(Configurable):
    """One random offset and a regular comb over the cumulative weights.

    A sample set whose size is found while drawing cannot use a comb of n teeth: cut short it covers
    only the first part of the weights. Its teeth come in the golden-ratio order instead, u_j =
    frac(u_0 + j (√5 − 1)/2): each u_j is uniform and every prefix is spread nearly as evenly as a
    comb [Kuipers, Niederreiter: Uniform distribution of sequences, ch. 2 §3].
    """

    needs_n: ClassVar[bool] = False

    def __call__(self, particles: Particles, n: int | None, draws: Draws) -> Ancestry:
        offset = float(_uniform(draws, 0, 1)[0])
        if n is None:
            search = Search(particles.weights)
            return Ancestry(lambda first, count: search.golden_comb(offset, first, count), n)
        ancestors = comb(particles.weights, offset, n)
        return Ancestry(lambda first, count: ancestors[first : first + count], n)


@dataclass(frozen=True)
class Residual(Configurable):
    """⌊n w⌋ descendants for certain, and independent ones in proportion to what remains of n w
    [Liu, Chen: Sequential Monte Carlo methods for dynamic systems, JASA 1998].
    """

    needs_n: ClassVar[bool] = True

    def __call__(self, particles: Particles, n: int | None, draws: Draws) -> Ancestry:
        shares = known_before(n) * particles.weights
        certain = np.floor(shares * (1.0 + 1e-12))  # n w = 1 may have been rounded down
        kept = np.repeat(np.arange(len(particles)), certain.astype(np.intp))
        search = Search(np.maximum(shares - certain, 0.0))

        def of(first: int, count: int) -> Indices:
            ancestors = kept[first : first + count]
            drawn = max(first, len(kept))
            if drawn >= first + count:
                return ancestors
            teeth = _uniform(draws, drawn, first + count - drawn)
            return np.concatenate([ancestors, search(teeth)])

        return Ancestry(of, n)


ALWAYS: dict[str, type[Resampler]] = {
    "systematic": Systematic,
    "stratified": Stratified,
    "residual": Residual,
    "multinomial": Multinomial,
}


@dataclass(frozen=True)
class WhenESSBelow:
    """Another resampler, but only where ESS < share · N; else the set and its size are kept."""

    share: float
    resampler: Resampler

    @property
    def needs_n(self) -> bool:
        return self.resampler.needs_n

    def __call__(self, particles: Particles, n: int | None, draws: Draws) -> Ancestry:
        size = len(particles)
        if particles.ess < self.share * size:
            return self.resampler(particles, n, draws)
        return Ancestry(
            lambda first, count: np.arange(first, first + count), size, particles.log_weights
        )


@dataclass(frozen=True)
class Selective(Configurable):
    """Resample only when the effective sample size is below a share of the set, else keep the set
    and its size.
    """

    ess_below: float = param(0.5, "", "resample only where ESS / N is below", above=0, high=1)
    method: str = param("systematic", "", "how to resample then", choices=tuple(ALWAYS))

    @property
    def needs_n(self) -> bool:
        return ALWAYS[self.method]().needs_n

    def __call__(self, particles: Particles, n: int | None, draws: Draws) -> Ancestry:
        return when_ess_below(self.ess_below, ALWAYS[self.method]())(particles, n, draws)


def when_ess_below(share: float, resampler: Resampler) -> Resampler:
    """`resampler`, but only when ESS < share · N."""
    return WhenESSBelow(share, resampler)


@dataclass(frozen=True)
class Tempered(Configurable):
    """Ancestors in proportion to w^power, which bring w^(1 − power) along [Liu, Chen, Logvinenko: A
    theoretical framework for sequential importance sampling with resampling, 2001, §3.2].

    A place that is unlikely for now keeps more particles than it deserves, of small weight, and is
    still there when later measurements speak for it.
    """

    power: float = param(0.3, "", "of the weights; 1: as they are", above=0, high=1)

    needs_n: ClassVar[bool] = False

    def __call__(self, particles: Particles, n: int | None, draws: Draws) -> Ancestry:
        log_w = particles.log_weights
        some = log_w > -np.inf
        drawn_by = Particles.normalized(particles.states, self.power * log_w)
        carried = np.full(len(log_w), -np.inf)
        np.subtract(log_w, drawn_by.log_weights, out=carried, where=some)
        ancestry = Systematic()(drawn_by, n, draws)
        return Ancestry(ancestry.of, ancestry.n, carried - np.log(len(log_w)))


RESAMPLERS: Registry[Resampler] = Registry(
    "resampler", {**ALWAYS, "selective": Selective, "tempered": Tempered}
)


def _uniform(draws: Draws, first: int, count: int) -> NDArray[np.float64]:
    """(count,): one uniform for each new particle, never 0 and never 1."""
    uniform: NDArray[np.float64] = draws.uniform(Stream.ANCESTOR, first, count)[0]
    return uniform


class Search:
    """Teeth in [0, 1] -> the particles at which they meet the cumulative weights; none of weight
    0.
    """

    def __init__(self, weights: NDArray[np.float64]) -> None:
        self.cumulative = np.cumsum(weights)
        total = float(self.cumulative[-1])
        # The last that weighs anything.
        self.last = int(np.searchsorted(self.cumulative, total))
        self.guide = np.zeros(len(weights) + 1, dtype=np.intp)
        if total > 0.0:
            first_above(weights, len(weights) / total, 0.0, self.guide)

    def __call__(self, teeth: NDArray[np.float64]) -> Indices:
        """(n,): what each of the teeth (n,) meets."""
        found = np.empty(len(teeth), dtype=np.intp)
        ancestors_of(teeth, self.cumulative, self.last, self.guide, found)
        return found

    def golden_comb(self, offset: float, first: int, count: int) -> Indices:
        """(count,): what the teeth first … of the golden-ratio comb meet."""
        found = np.empty(count, dtype=np.intp)
        ancestors_of_golden_comb(offset, first, self.cumulative, self.last, self.guide, found)
        return found


def comb(weights: NDArray[np.float64], offset: float, n: int) -> Indices:
    """(n,): what the teeth (offset + j) / n meet. weights: their sum is 1."""
    found = np.empty(n, dtype=np.intp)
    first_above(weights, float(n), offset, found)
    return found


def _halving_teeth(draws: Draws, n: int) -> NDArray[np.float64]:
    """(n,): the first n teeth. Tooth 2^k + i lies in the half of the stratum of tooth i, 2^−k wide,
    in which that one does not lie.
    """
    fresh = np.floor(_uniform(draws, 0, n) * 2.0**32).astype(np.int64)
    teeth = fresh[:1]
    for k in range((n - 1).bit_length()):
        other = (teeth >> (31 - k)) ^ 1
        jitter = fresh[len(teeth) : 2 * len(teeth)] >> (k + 1)
        teeth = np.concatenate([teeth, (other[: len(jitter)] << (31 - k)) + jitter])
    return (teeth.astype(np.float64) + 0.5) * 2.0**-32
