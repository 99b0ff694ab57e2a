"""Which sensor model a node has: virtual low-resolution ones near the root, and no coarse ones deep
down  [Est §4, point 3].
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from mcloc.filters.hierarchical.region import Region
from mcloc.protocols import SensorModel
from mcloc.sensors.low_resolution import LeftOut, LowResolution


@dataclass(frozen=True)
class Sensing:
    """virtual: a sensor as nodes near the root have it, by their region. coarse: {source: what the
    sensor can tell apart, in units of the straight axes}; a node whose region is narrower leaves it
    out.
    """

    virtual: Callable[[SensorModel, Region], SensorModel]
    coarse: Mapping[str, float] = field(default_factory=dict)

    def of(self, sensor: SensorModel, region: Region, z: Any, shallow: bool) -> SensorModel:
        """The sensor for a node's region; positive everywhere, so that what nothing explains is not
        taken for proof.
        """
        if region.widest() < self.coarse.get(sensor.source(z), 0.0):
            return LeftOut(sensor)
        return self.virtual(sensor, region) if shallow else LowResolution(sensor)
