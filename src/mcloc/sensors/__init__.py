"""Sensor models p(z_t | x_t)."""

from mcloc.protocols import SensorModel
from mcloc.registry import Registry
from mcloc.sensors.beacons import BeaconModel
from mcloc.sensors.beam_presets import FourPartBeams, Fox01Beams, YeeBeams
from mcloc.sensors.ceiling import CeilingBrightness
from mcloc.sensors.ceiling_patch import CeilingPatch
from mcloc.sensors.landmarks import LandmarkModel
from mcloc.sensors.likelihood_field import LikelihoodField
from mcloc.sensors.messages import MessageModel
from mcloc.sensors.sonar import SonarBeams

SENSORS: Registry[SensorModel] = Registry(
    "sensor",
    {
        "likelihood-field": LikelihoodField,
        "beam-four-part": FourPartBeams,
        "beam-fox01": Fox01Beams,
        "beam-yee": YeeBeams,
        "sonar": SonarBeams,
    },
)
"""Of scans."""

SIGHTINGS: Registry[SensorModel] = Registry("sightings", {"landmarks": LandmarkModel})
"""Of sightings of landmarks."""

CAMERAS: Registry[SensorModel] = Registry(
    "camera", {"ceiling-patch": CeilingPatch, "ceiling-brightness": CeilingBrightness}
)
"""Of images of the ceiling."""

RANGINGS: Registry[SensorModel] = Registry("ranging", {"beacons": BeaconModel})
"""Of ranges to radio beacons."""

MESSAGES: Registry[SensorModel] = Registry("message", {"density-tree": MessageModel})
"""Of what other robots tell."""
