"""When a filter should doubt itself: its wheels at once, its place in the long run.

Both judge by the *unnormalized* likelihood of the scans: once normalized, weights know nothing of
how well the map explains a scan.
"""

from dataclasses import dataclass
from typing import Protocol

from mcloc.registry import Configurable, Registry, param

LITTLE = 0.002  # of the belief; a filter with no more of it elsewhere is sure of the place


@dataclass(frozen=True, slots=True)
class Evidence:
    """Short and long running average of the likelihood of one reading.

    Of one reading, the mean of p(z | x)^(1/readings) over the predictive density, so that scans of
    any length and novelty compare. fast: how well scans fit now. slow: how well they usually fit
    where the filter is sure of the place; the same as fast while that is not known. Both are 0
    before the first scan. readings: on how many readings slow rests.
    """

    fast: float = 0.0
    slow: float = 0.0
    readings: float = 0.0

    def updated(
        self, likelihood: float, readings: float, rates: tuple[float, float], sure: bool = True
    ) -> "Evidence":
        """w ← w + rate (w_avg − w) [Probabilistic Robotics, Table 8.3], with rates per reading: n
        readings count 1 − (1 − rate)ⁿ. An average over fewer readings than 1 / rate is their mean.

        sure: whether the filter is sure of the place. Else nothing is learned of what is usual: the
        likelihood is that of many places, most of them wrong.
        """
        total = self.readings + readings
        fast, slow = (max(1.0 - (1.0 - rate) ** readings, readings / total) for rate in rates)
        now = self.fast + fast * (likelihood - self.fast)
        if not sure:
            return Evidence(now, self.slow if self.known else now, self.readings)
        return Evidence(now, self.slow + slow * (likelihood - self.slow), total)

    @property
    def known(self) -> bool:
        """Whether anything is known of what is usual."""
        return self.readings > 0.0


class Recovery(Protocol):
    """Decides how far a step trusts what the filter believed."""

    @property
    def rates(self) -> tuple[float, float]:
        """How fast the short and the long average of Evidence follow, per reading."""

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
        0.05, "1/reading", "rate of the short average of the likelihood", above=0, high=1
    )
    rate_slow: float = param(0.002, "1/reading", "rate of the long average", above=0, high=1)
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
        return _shortfall(likelihood, evidence, self.doubt_below)


@dataclass(frozen=True, slots=True)
class WithoutRandomParticles:
    """Another recovery, but for its random particles: something else is done instead of them."""

    recovery: Recovery

    @property
    def rates(self) -> tuple[float, float]:
        return self.recovery.rates

    def alpha(self, evidence: Evidence) -> float:
        return 0.0

    def doubt(self, evidence: Evidence, likelihood: float) -> float:
        return self.recovery.doubt(evidence, likelihood)


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

    The short average looks back on 1 / rate_fast = 20 readings, about two scans that are all news.
    To fit 0.7 times as well as usual over so many is e⁻⁷ times as likely. On 7 recorded logs of
    tracked robots the least ratio was 0.56 (wheels that report backwards as forwards), 0.60 (people
    around the robot) and 0.67 … 0.77 in the others; of 31 robots that were carried off it was below
    0.7 within 1 m in 28, and within 1.5 m in the others.
    """

    below: float = param(
        0.7, "", "random particles where short / long average is below", above=0, high=1
    )

    def alpha(self, evidence: Evidence) -> float:
        return _shortfall(evidence.fast, evidence, self.below)


def _shortfall(now: float, evidence: Evidence, below: float) -> float:
    """By how much `now` falls short of the share `below` of what is usual: 0 … 1, 0 where nothing
    is usual yet.
    """
    if not evidence.known or below * evidence.slow == 0.0:
        return 0.0
    return max(0.0, 1.0 - now / (below * evidence.slow))


RECOVERIES: Registry[Recovery] = Registry(
    "recovery", {"none": NoRandomParticles, "random": RandomParticles, "augmented": Augmented}
)
