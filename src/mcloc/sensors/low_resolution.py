"""A precise sensor seen from afar: max over δ of p(z | x + δ)^power · exp(−fall(δ))  [Est §4, point
3: virtual low resolution sensors].
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcloc.protocols import SensorModel
from mcloc.statespace import LogWeights, States

LEAST = -600.0  # log p(z | x) of what nothing explains: exp of it is still a number


def nowhere() -> NDArray[np.float64]:
    """(D, 0): no other states to look at."""
    return np.empty((0, 0))


@dataclass(frozen=True, eq=False)
class LowResolution:
    """A virtual low-resolution sensor, of any sensor model. What is likely by p stays so; what is
    not is the likelier the nearer it is to something likely.

        log p̃(z | x) = max(max_δ [power · log p(z | x + δ) − fall(δ)], least)

    offsets: (D, K) the δ, in the axes' units. falls: (K,) > 0, what each takes from log p. δ = 0,
    which takes nothing, is always looked at. power: above 0, up to 1.

    So it is positive everywhere. Its maxima over x are those of p: for a pose to reach that value
    through another takes something off. And it is p^power, which rises and falls with p, where p
    falls by less than `falls`; elsewhere it falls by these, as far as the offsets reach.
    """

    sensor: SensorModel
    power: float = 1.0
    offsets: NDArray[np.float64] = field(default_factory=nowhere)
    falls: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    def log_likelihood(self, x: States, z: Any) -> LogWeights:
        """(n,): log p̃(z | x)."""
        best = np.maximum(self.power * self.sensor.log_likelihood(x, z), LEAST)
        if len(self.falls):
            near = (x[:, None, :] + self.offsets[:, :, None]).reshape(len(x), -1)
            seen = self.power * self.sensor.log_likelihood(near, z).reshape(-1, x.shape[1])
            np.maximum(best, (seen - self.falls[:, None]).max(axis=0), out=best)
        return best

    def readings(self, z: Any) -> float:
        """As many as the power leaves of them."""
        return self.power * self.sensor.readings(z)

    def beams(self, z: Any) -> int:
        """Those of the sensor, for each state that is looked at."""
        return self.sensor.beams(z) * (1 + len(self.falls))

    def source(self, z: Any) -> str:
        """That of the sensor."""
        return self.sensor.source(z)

    def explained(self, x: States, z: Any) -> NDArray[np.float64]:
        """(n,): that of the sensor."""
        return self.sensor.explained(x, z)


@dataclass(frozen=True)
class LeftOut:
    """A sensor that tells nothing: p(z | x) = 1."""

    sensor: SensorModel

    def log_likelihood(self, x: States, z: Any) -> LogWeights:
        """(n,): 0."""
        return np.zeros(x.shape[1])

    def readings(self, z: Any) -> float:
        """Those of the sensor."""
        return self.sensor.readings(z)

    def beams(self, z: Any) -> int:
        """0: none is looked at."""
        return 0

    def source(self, z: Any) -> str:
        """That of the sensor."""
        return self.sensor.source(z)

    def explained(self, x: States, z: Any) -> NDArray[np.float64]:
        """(n,): NaN, for nothing is asked."""
        return np.full(x.shape[1], np.nan)
