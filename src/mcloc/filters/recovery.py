"""When a filter should doubt itself: its wheels at once, its place in the long run.

Both judge by the *unnormalized* likelihood of the scans: once normalized, weights know nothing of
how well the map explains a scan.
"""

from dataclasses import dataclass
from typing import Protocol

from mcloc.registry import Configurable, Registry, param


@dataclass(frozen=True, slots=True)
class Evidence:
    """Short and long running average of the likelihood of one reading; None before the first.

    Of one reading, the mean of p(z | x)^(1/readings) over the predictive density, so that scans of
    any length and novelty compare.
    """

    fast: float | None = None
    slow: float | None = None

    def updated(self, likelihood: float, rates: tuple[float, float]) -> "Evidence":
        """w ← w + rate (w_avg − w) [Probabilistic Robotics, Table 8.3]; the first scan starts
        both.
        """
        if self.fast is None or self.slow is None:
            return Evidence(likelihood, likelihood)
        fast, slow = rates
        return Evidence(
            self.fast + fast * (likelihood - self.fast), self.slow + slow * (likelihood - self.slow)
        )


class Recovery(Protocol):
    """Decides how far a step trusts what the filter believed."""

    @property
    def rates(self) -> tuple[float, float]:
        """How fast the short and the long average of Evidence follow, per update."""

    def alpha(self, evidence: Evidence) -> float:
        """α of (1 − α) p_d + α U: the uniform share of the dynamics, 0 … 1  [Yee Eq. 1]."""

    def doubt(self, evidence: Evidence, likelihood: float) -> float:
        """The share of particles for which the wheels are not believed, given this scan's
        likelihood per reading.
        """


@dataclass(frozen=True)
class NoRandomParticles(Configurable):
    """No random particles: a filter that has lost the robot stays lost.

    Wheels that lie are caught all the same. Where a scan is explained worse than usual, w <
    doubt_below · w_slow, the step is drawn again with a share 1 − w / (doubt_below · w_slow) of
    moves from the motion model's `doubted` version, in the way of sensor resetting [Lenser, Veloso:
    ICRA 2000] but around the robot instead of anywhere.
    """

    rate_fast: float = param(
        0.1, "", "rate of the short average of the likelihood", above=0, high=1
    )
    rate_slow: float = param(0.02, "", "rate of the long average", above=0, high=1)
    doubt_below: float = param(
        0.75,
        "",
        "doubt the wheels where likelihood / long average is below; 0: never",
        low=0,
        high=1,
    )

    @property
    def rates(self) -> tuple[float, float]:
        return self.rate_fast, self.rate_slow

    def alpha(self, evidence: Evidence) -> float:
        return 0.0

    def doubt(self, evidence: Evidence, likelihood: float) -> float:
        return _shortfall(likelihood, evidence.slow, self.doubt_below)


@dataclass(frozen=True)
class RandomParticles(NoRandomParticles):
    """A constant share of random particles [Fox99; Fox01 §19.3.4]."""

    share: float = param(0.02, "", "share of random particles", low=0, high=1)

    def alpha(self, evidence: Evidence) -> float:
        return self.share


@dataclass(frozen=True)
class Augmented(NoRandomParticles):
    """α = max(0, 1 − w_fast / (below · w_slow)) [Probabilistic Robotics, Table 8.3, where `below`
    is 1; Gutmann, Fox: IROS 2002, where it is 1/ν].
    """

    below: float = param(
        0.75, "", "random particles where short / long average is below", above=0, high=1
    )

    def alpha(self, evidence: Evidence) -> float:
        return _shortfall(evidence.fast, evidence.slow, self.below)


def _shortfall(now: float | None, usual: float | None, below: float) -> float:
    """By how much `now` falls short of the share `below` of what is usual: 0 … 1, 0 where nothing
    is usual yet.
    """
    if now is None or usual is None or below * usual == 0.0:
        return 0.0
    return max(0.0, 1.0 - now / (below * usual))


RECOVERIES: Registry[Recovery] = Registry(
    "recovery", {"none": NoRandomParticles, "random": RandomParticles, "augmented": Augmented}
)
