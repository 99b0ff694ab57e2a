"""Poses from whatever a robot's sensors tell."""

from collections.abc import Mapping
from dataclasses import dataclass

from mcloc.draws import Draws
from mcloc.errors import ConfigError
from mcloc.events import Measurement
from mcloc.protocols import PoseDensity, PoseSampler


@dataclass(frozen=True, eq=False)
class FusedSampler:
    """samplers: by the kind of measurement. Raises ConfigError for one that none is for."""

    samplers: Mapping[type[Measurement], PoseSampler]

    def given(self, z: Measurement, draws: Draws) -> PoseDensity:
        """The density of the sampler for this kind of measurement."""
        sampler = self.samplers.get(type(z))
        if sampler is None:
            raise ConfigError(f"no poses can be drawn from a {z.called}; take --filter mcl")
        return sampler.given(z, draws)
