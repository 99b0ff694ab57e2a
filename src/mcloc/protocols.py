"""The roles that parts play. Every filter is made of these."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws
from mcloc.particles import Particles
from mcloc.statespace import LogWeights, States, StateSpace

Indices = NDArray[np.integer[Any]]


class MotionModel(Protocol):
    """p(x_t | u_t, x_{t−1}). What u is, each model says."""

    def sample(self, x: States, u: Any, draws: Draws, first: int) -> States:
        """(D, n): a successor for each column of x, which are the particles first … first + n −
        1.
        """

    def log_density(self, x_new: States, u: Any, x: States) -> LogWeights:
        """(n,): log p(x_new | u, x), column by column."""

    def sample_previous(self, x_new: States, u: Any, draws: Draws, first: int) -> States:
        """(D, n): x_{t−1} drawn from p(x_new | u, x_{t−1}) / π(x_new | u)  [Fox01 Eq. 19.3.12]."""

    def log_pi(self, x_new: States, u: Any) -> LogWeights:
        """(n,): log π(x_new | u) = log ∫ p(x_new | u, x_{t−1}) dx_{t−1}."""

    def doubted(self) -> "MotionModel":
        """The same model for wheels that must have lied; itself where there is no such thing."""


class SensorModel(Protocol):
    """p(z_t | x_t) up to a factor that does not depend on x."""

    def log_likelihood(self, x: States, z: Any) -> LogWeights:
        """(n,): log p(z | x) for each column of x."""

    def readings(self, z: Any) -> float:
        """How many independent readings the likelihood takes z for, > 0."""

    def beams(self, z: Any) -> int:
        """How many beams of z are used: what a particle costs to be weighed."""

    def source(self, z: Any) -> str:
        """Which of the robot's sensors z comes from: likelihoods compare within one."""

    def explained(self, x: States, z: Any) -> NDArray[np.float64]:
        """(n,): the share of the readings that the map explains at each x, NaN where z has none."""


class Density(Protocol):
    """A probability density over states."""

    def sample(self, draws: Draws, first: int, n: int) -> States:
        """(D, n): the particles first … first + n − 1."""

    def log_density(self, x: States) -> LogWeights:
        """(n,): log density at each column of x."""


class Environment(Density, Protocol):
    """Where a robot can be. As a density it is U(x), uniform over these places."""

    def log_prior(self, x: States) -> LogWeights:
        """(n,): log p(x | m), 0 where a robot can be, less where it hardly can."""


class PoseDensity(Density, Protocol):
    """q̄(x) ≈ p(z | x) / π(z) for one measurement z, positive wherever a robot can be  [Fox01 Eq.
    19.3.7].
    """

    @property
    def log_pi(self) -> float:
        """log π(z), π(z) = ∫ p(z | x) dx, as far as it is known."""


class PoseSampler(Protocol):
    """Poses from a measurement: what dual and mixture MCL draw from."""

    def given(self, z: Any, draws: Draws) -> PoseDensity:
        """The density for one measurement, under the same tempered likelihood as the filter."""


Predictive = Callable[[int], Particles]
"""n -> n particles of p(x_t | u_t, d_{0…t−1}), what is believed before the measurement."""


class PeopleFilter(Protocol):
    """Takes readings out of a measurement that the map cannot explain."""

    def without_people(self, z: Any, predictive: Predictive) -> tuple[Any, float]:
        """z without them, and the share of its returns that they are, 0 … 1."""


class Counter(Protocol):
    """Watches particles being drawn and says when there are enough."""

    def enough(self, states: States, log_weights: LogWeights) -> int | None:
        """Of the particles just drawn, how many belong to the set; None while more are needed."""


class SampleSize(Protocol):
    """How many particles a part draws."""

    @property
    def fixed(self) -> int | None:
        """The number where it is known before drawing, else None."""

    def counter(self, space: StateSpace, step: int, nth: int) -> Counter:
        """A new count for the nth sample set, from 0, that is drawn in a step."""


class Weighed(NamedTuple):
    """Particles that were drawn and weighed, not yet normalized.

    states: (D, n). log_before: (n,) what each weighs before the measurement. log_likelihoods: (n,)
    log p(z | x).
    """

    states: States
    log_before: LogWeights
    log_likelihoods: LogWeights

    @property
    def log_weights(self) -> LogWeights:
        """(n,): target / q."""
        return self.log_before + self.log_likelihoods

    def first(self, n: int | None) -> "Weighed":
        """The first n particles, all of them for None."""
        return Weighed(self.states[:, :n], self.log_before[:n], self.log_likelihoods[:n])


Source = Callable[[int, int], Weighed]
"""(first, n) -> the particles first … first + n − 1."""
