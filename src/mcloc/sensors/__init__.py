"""Sensor models p(z_t | x_t)."""

from mcloc.protocols import SensorModel
from mcloc.registry import Registry
from mcloc.sensors.beam_presets import FourPartBeams, Fox01Beams, YeeBeams
from mcloc.sensors.landmarks import LandmarkModel
from mcloc.sensors.likelihood_field import LikelihoodField

SENSORS: Registry[SensorModel] = Registry(
    "sensor",
    {
        "likelihood-field": LikelihoodField,
        "beam-four-part": FourPartBeams,
        "beam-fox01": Fox01Beams,
        "beam-yee": YeeBeams,
    },
)
"""Of scans."""

SIGHTINGS: Registry[SensorModel] = Registry("sightings", {"landmarks": LandmarkModel})
"""Of sightings of landmarks."""
