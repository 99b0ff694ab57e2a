"""Several kinds of sensors in one filter: each measurement is weighed by the model of its kind."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.events import Measurement
from mcloc.protocols import SensorModel
from mcloc.statespace import LogWeights, States


@dataclass(frozen=True, eq=False)
class Fused:
    """p(z | x) of whatever a robot's sensors tell; at each step any of them may be missing.

    models: by the kind of measurement. Raises ConfigError for a measurement that none is for.
    """

    models: Mapping[type[Measurement], SensorModel]

    def of(self, z: Measurement) -> SensorModel:
        """The model for a measurement."""
        model = self.models.get(type(z))
        if model is None:
            raise ConfigError(
                f"a {z.called} cannot be weighed: the map has nothing that it could be of; give a "
                f"map for it, or leave {z.called}s out of the log"
            )
        return model

    def log_likelihood(self, x: States, z: Measurement) -> LogWeights:
        """(n,): log p(z | x)."""
        return self.of(z).log_likelihood(x, z)

    def readings(self, z: Measurement) -> float:
        """How many independent readings z is taken for."""
        return self.of(z).readings(z)

    def beams(self, z: Measurement) -> int:
        """What a particle costs to be weighed."""
        return self.of(z).beams(z)

    def source(self, z: Measurement) -> str:
        """Which sensor z comes from."""
        return self.of(z).source(z)

    def explained(self, x: States, z: Measurement) -> NDArray[np.float64]:
        """(n,): the share of the readings that the map explains."""
        return self.of(z).explained(x, z)
