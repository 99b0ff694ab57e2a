"""p(z | e) = Σ_c z_c p_c(z | e) / Σ_c z_c: mixtures of causes, three because the papers differ."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.registry import param
from mcloc.sensors.beam_densities import exponential, hit, miss, no_return, short, uniform
from mcloc.sensors.beam_model import BeamModel


@dataclass(frozen=True)
class FourPartBeams(BeamModel):
    """Beam model of the book: hit, short, no return, random  [Probabilistic Robotics, Table 6.1].

    The four weights are taken relative to their sum. Something nearer than σ_hit to the wall
    cannot be told from it. The default weights have the numbers of ROS's amcl.
    """

    z_hit: float = param(0.95, "", "weight of the expected wall", above=0, high=1)
    z_short: float = param(0.1, "", "weight of things before the wall", low=0, high=1)
    z_max: float = param(0.05, "", "weight of no return", above=0, high=1)
    z_rand: float = param(0.05, "", "weight of readings without a cause", above=0, high=1)
    lambda_short: float = param(
        0.1, "1/m", "rate at which things stand before the wall", above=0, high=100
    )

    def mixture(
        self, z: NDArray[np.float64], e: NDArray[np.float64], range_max: float
    ) -> NDArray[np.float64]:
        before = short(z, np.maximum(e, self.sigma_hit), range_max, self.lambda_short)
        total = (
            self.z_hit * hit(z, e, range_max, self.deviation(e, range_max))
            + self.z_short * before
            + self.z_max * no_return(z, range_max)
            + self.z_rand * uniform(z, range_max)
        )
        return total / (self.z_hit + self.z_short + self.z_max + self.z_rand)


@dataclass(frozen=True)
class Fox01Beams(BeamModel):
    """Beam model of Fox01 §19.2.2: the correct reading with Gaussian noise, a max-range reading,
    and random noise that is exponentially distributed, whatever the wall.

    The weights are taken relative to their sum; the paper gives none.
    """

    z_hit: float = param(0.8, "", "weight of the correct reading", above=0, high=1)
    z_max: float = param(0.1, "", "weight of max-range readings", above=0, high=1)
    z_rand: float = param(0.1, "", "weight of random noise", above=0, high=1)
    lambda_rand: float = param(
        0.1, "1/m", "rate of the random noise's exponential", above=0, high=100
    )

    def mixture(
        self, z: NDArray[np.float64], e: NDArray[np.float64], range_max: float
    ) -> NDArray[np.float64]:
        total = (
            self.z_hit * hit(z, e, range_max, self.deviation(e, range_max))
            + self.z_max * no_return(z, range_max)
            + self.z_rand * exponential(z, range_max, self.lambda_rand)
        )
        return total / (self.z_hit + self.z_max + self.z_rand)


@dataclass(frozen=True)
class YeeBeams(BeamModel):
    """Beam model of Yee §2: a Gaussian around the expected range, an exponential for maximum-range
    readings and for obstacles that the sensor fails to see, and a uniform for unknown obstacles.

    The exponential starts at the wall that was missed and ends in no return, so that it models
    both. The weights are taken relative to their sum; the paper gives none.
    """

    z_hit: float = param(0.8, "", "weight of a known obstacle that is seen", above=0, high=1)
    z_miss: float = param(0.1, "", "weight of a known obstacle that is missed", above=0, high=1)
    z_rand: float = param(0.1, "", "weight of unknown obstacles", above=0, high=1)
    lambda_miss: float = param(
        0.1, "1/m", "rate of readings beyond an obstacle that is missed", above=0, high=100
    )

    def mixture(
        self, z: NDArray[np.float64], e: NDArray[np.float64], range_max: float
    ) -> NDArray[np.float64]:
        total = (
            self.z_hit * hit(z, e, range_max, self.deviation(e, range_max))
            + self.z_miss * miss(z, e, range_max, self.lambda_miss)
            + self.z_rand * uniform(z, range_max)
        )
        return total / (self.z_hit + self.z_miss + self.z_rand)
