"""What every filter is: a belief in, a belief out."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from mcloc.draws import Draws
from mcloc.estimate import Hypothesis
from mcloc.filters.recovery import Evidence
from mcloc.particles import Particles
from mcloc.protocols import Density, Environment, SensorModel
from mcloc.storage import Arrays


class Belief(Protocol):
    """What a filter carries from step to step: a value, of a kind that the filter knows."""

    @property
    def particles(self) -> Particles:
        """Weighted states that stand for it: what is drawn and recorded of any belief."""

    @property
    def evidence(self) -> Mapping[str, Evidence]:
        """How well the scans of each sensor fit, now and usually."""


B = TypeVar("B", bound=Belief)


@dataclass(frozen=True, slots=True)
class StepInfo:
    """What was learned on the way.

    n: states that the belief rests on, particles or cells. ess: effective sample size after
    weighing. log_evidence: an estimate of log p(z_t | d_{0…t−1}). alpha: the uniform share of the
    dynamics. doubt: the share of moves for which the wheels were not believed. evidence: of the
    sensor that was used, this measurement included. sizes: of all sample sets that were drawn, in
    order. filtered: the share of the measurement's returns that were left out, for people or their
    like. weighed: at how many states the measurement was weighed.
    """

    n: int
    ess: float
    log_evidence: float
    evidence: Evidence
    weighed: int
    alpha: float = 0.0
    doubt: float = 0.0
    sizes: tuple[int, ...] = ()
    filtered: float = 0.0


class Filter(Protocol[B]):
    """Bel(x_t) ∝ p(z_t | x_t) ∫ p(x_t | u_t, x_{t−1}) Bel(x_{t−1}) dx_{t−1}  [Fox01 Eq. 19.2.3].
    Randomness is an argument; a filter without any takes it too.
    """

    @property
    def sensor(self) -> SensorModel:
        """p(z | x)."""

    @property
    def environment(self) -> Environment:
        """Where a robot can be; `start` with it as the density is to know nothing of the place."""

    def start(self, initial: Density, draws: Draws) -> B:
        """The belief before the first scan. Raises ConfigError for a density that this filter
        cannot start from.
        """

    def step(self, bel: B, u: Any, z: Any, draws: Draws) -> tuple[B, StepInfo]:
        """The belief after moving by u and measuring z. Raises FilterError where it is 0
        everywhere.
        """

    def hypotheses(self, bel: B) -> tuple[Hypothesis, ...]:
        """Where the robot may be, most likely first; none while the filter withholds its
        estimate.
        """

    def adopted(self, bel: B) -> B:
        """The belief of such a filter on another map of the same frame, for this one. How well
        scans fit is learned anew: likelihoods on two maps do not compare.
        """

    def packed(self, bel: B) -> tuple[dict[str, Any], Arrays]:
        """The belief but for its evidence, as what JSON knows and as arrays."""

    def unpacked(self, values: dict[str, Any], arrays: Arrays, evidence: dict[str, Evidence]) -> B:
        """The belief that `packed` describes."""
