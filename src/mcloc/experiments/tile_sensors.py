"""A robot on tiles with a precise and a coarse light sensor: for what is left out of deep nodes
[Est §4, point 3].
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcloc.sensors.grey_tile import Greys, GreySensor
from mcloc.statespace import LogWeights, States


class Reading(NamedTuple):
    """What one of the sensors read."""

    source: str
    values: Greys


@dataclass(frozen=True)
class OneOfBoth:
    """Two sensors above the same tiles, of which one reads at each iteration, as chance has it."""

    precise: GreySensor
    coarse: GreySensor

    @property
    def shape(self) -> tuple[int, ...]:
        """The tiles."""
        return self.precise.shape

    def of(self, z: Reading) -> GreySensor:
        """The sensor that read it."""
        return self.coarse if z.source == "coarse" else self.precise

    def log_likelihood(self, x: States, z: Reading) -> LogWeights:
        """(n,): log p(z | x)."""
        return self.of(z).log_likelihood(x, z.values)

    def readings(self, z: Reading) -> float:
        """1 for each channel."""
        return self.of(z).readings(z.values)

    def beams(self, z: Reading) -> int:
        """1 for each channel."""
        return self.of(z).beams(z.values)

    def source(self, z: Reading) -> str:
        """precise or coarse."""
        return z.source

    def explained(self, x: States, z: Reading) -> NDArray[np.float64]:
        """(n,): as of the sensor."""
        return self.of(z).explained(x, z.values)

    def sample(self, x: NDArray[np.float64], rng: np.random.Generator) -> Reading:
        """What is read on a tile x (D,), for simulation."""
        coarse = rng.random() < 0.5
        sensor = self.coarse if coarse else self.precise
        return Reading("coarse" if coarse else "precise", sensor.sample(x, rng))
