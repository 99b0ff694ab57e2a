"""What filters are composed of, and how."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from mcloc.filters.filter import Filter
from mcloc.filters.particle_filter import Part, ParticleFilter
from mcloc.filters.recovery import Recovery
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.protocols import (
    Environment,
    MotionModel,
    PeopleFilter,
    PoseSampler,
    SampleSize,
    SensorModel,
)
from mcloc.resampling import Resampler, known_before


@dataclass(frozen=True)
class Models:
    """What filters are composed of. sampler: makes the pose sampler, which not all of them need."""

    grid: OccupancyGrid
    motion: MotionModel
    sensor: SensorModel
    environment: Environment
    size: SampleSize
    resampler: Resampler
    recovery: Recovery
    people: PeopleFilter
    sampler: Callable[[], PoseSampler]

    def filter(self, *parts: Part) -> ParticleFilter:
        """A particle filter of such parts. Raises ConfigError for a resampler that has to know
        sizes which are found while drawing.
        """
        if self.resampler.needs_n:
            for part in parts:
                known_before(part.size.fixed)
        models = self.motion, self.sensor, self.environment
        return ParticleFilter(*models, parts, self.recovery, people=self.people)


class FilterKind(Protocol):
    """A way to compose a filter."""

    def compose(self, models: Models) -> Filter[Any]:
        """The filter made of these models. Raises ConfigError where they do not go together."""
