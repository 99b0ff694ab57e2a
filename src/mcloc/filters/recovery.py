"""How much of the predictive density is uniform: α in (1 − α) p_d + α U  [Yee Eq. 1]."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mcloc.registry import Part, Registry, param


@dataclass(frozen=True, slots=True)
class Evidence:
    """Running averages of the likelihood of the measurements, short and long; 0 before the first.

    What is averaged is the *unnormalized* predictive likelihood (1/N) Σ p(z | x^(i)): once normalized, weights
    know nothing of how well the map explains the scan. It is taken per independent reading, that is to
    the power 1/readings, so that scans of any length compare.
    """

    fast: float = 0.0
    slow: float = 0.0

    def updated(self, log_evidence: float, readings: float, rates: tuple[float, float]) -> "Evidence":
        """w ← w + rate (w_avg − w); the first measurement starts both averages."""
        average = float(np.exp(log_evidence / readings))
        if self.slow == 0.0:
            return Evidence(average, average)
        fast, slow = rates
        return Evidence(
            self.fast + fast * (average - self.fast), self.slow + slow * (average - self.slow)
        )


class Recovery(Protocol):
    """Decides α before each step."""

    @property
    def rates(self) -> tuple[float, float]:
        """How fast the short and the long average of Evidence follow, per update."""

    def alpha(self, evidence: Evidence) -> float:
        """The share of uniform particles, 0 … 1."""


@dataclass(frozen=True)
class NoRecovery(Part):
    """α = 0: a filter that has lost the robot stays lost."""

    rate_fast: float = param(0.1, "", "rate of the short average", above=0, high=1)
    rate_slow: float = param(0.01, "", "rate of the long average", above=0, high=1)

    @property
    def rates(self) -> tuple[float, float]:
        return self.rate_fast, self.rate_slow

    def alpha(self, evidence: Evidence) -> float:
        return 0.0


@dataclass(frozen=True)
class RandomParticles(NoRecovery):
    """A constant share of random particles [Fox99; Fox01 §19.2.5]."""

    share: float = param(0.05, "", "share of random particles", low=0, high=1)

    def alpha(self, evidence: Evidence) -> float:
        return self.share


@dataclass(frozen=True)
class Augmented(NoRecovery):
    """α = max(0, 1 − w_fast/w_slow) [Thrun, Burgard, Fox: Probabilistic Robotics, Table 8.3]."""

    def alpha(self, evidence: Evidence) -> float:
        return max(0.0, 1.0 - evidence.fast / evidence.slow) if evidence.slow > 0.0 else 0.0


RECOVERIES: Registry[Recovery] = Registry(
    "recovery", {"none": NoRecovery, "random": RandomParticles, "augmented": Augmented}
)
