"""p(z | e) = w N(z; e, σ²) + p_specular p_miss(z | e) + p_crosstalk / z_max,  e = min_φ e(φ) over
the cone: Yee's density, by what happens to a sonar  [Yee §2].
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.events import Scan
from mcloc.registry import param
from mcloc.sensors.beam_densities import hit, miss, uniform
from mcloc.sensors.beam_model import BeamModel


@dataclass(frozen=True)
class SonarBeams(BeamModel):
    """Beam model of a ring of sonars: each measures the first obstacle in its cone.

    A smooth wall that is met aslant mirrors the sound away: a share `specular` of the echoes comes
    from what stands behind it, or not at all. A share `crosstalk` are another sonar's, at any
    range. Few sonars look at the same surface: a scan is worth as many readings as there are
    sonars, up to effective_beams.
    """

    sigma_hit: float = param(
        0.05, "m", "deviation of returns from the expected range", low=1e-3, high=5
    )
    sigma_relative: float = param(
        0.05, "m/m", "deviation that grows with the expected range", low=0, high=0.3
    )
    cone: float = param(
        math.radians(20.0),
        "rad",
        "opening angle of a beam, which measures the nearest wall in it",
        above=0,
        high=np.pi,
    )
    specular: float = param(0.1, "", "share of echoes that a wall mirrors away", above=0, high=0.9)
    crosstalk: float = param(0.1, "", "share of echoes of another sonar", above=0, high=0.9)
    lambda_miss: float = param(
        0.1, "1/m", "rate of echoes from behind a wall that mirrors", above=0, high=100
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.specular + self.crosstalk >= 1.0:
            raise self.wrong(
                f"specular + crosstalk must be below 1, got {self.specular + self.crosstalk:g}"
            )

    def readings(self, z: Scan) -> float:
        """The sonars that are used, effective_beams at most, × novelty."""
        return min(self.effective_beams, max(self.beams(z), 1)) * z.novelty

    def mixture(
        self, z: NDArray[np.float64], e: NDArray[np.float64], range_max: float
    ) -> NDArray[np.float64]:
        seen = 1.0 - self.specular - self.crosstalk
        density: NDArray[np.float64] = (
            seen * hit(z, e, range_max, self.deviation(e, range_max))
            + self.specular * miss(z, e, range_max, self.lambda_miss)
            + self.crosstalk * uniform(z, range_max)
        )
        return density
