"""Hierarchical MCL by name, on maps."""

import math
from dataclasses import dataclass

import numpy as np

from mcloc.filters.hierarchical.description import Description, FullStates
from mcloc.filters.hierarchical.domain import Boxes
from mcloc.filters.hierarchical.hierarchical_mcl import HierarchicalMCL
from mcloc.filters.hierarchical.node import Equal, Halving
from mcloc.filters.hierarchical.nodes import MOST_LEVELS
from mcloc.filters.hierarchical.region import Region
from mcloc.filters.hierarchical.sensing import Sensing
from mcloc.filters.hierarchical.techniques import Techniques
from mcloc.filters.hierarchical.zones import ZoneOnly
from mcloc.filters.models import Models
from mcloc.filters.particle_filter import Part
from mcloc.filters.recovery import NoRandomParticles
from mcloc.proposals.forward import Forward
from mcloc.proposals.renewed import Renewed
from mcloc.protocols import SensorModel
from mcloc.registry import param
from mcloc.sample_size import Fixed
from mcloc.sensors.low_resolution import LowResolution


@dataclass(frozen=True)
class Hierarchical(Techniques):
    """Hierarchical MCL: a tree of particle filters, each of which says in which half of its region
    the robot is. It answers "which half?" at once and "which cell?" deeper down [Est].

    Of recovery it takes how fast the averages follow; it knows no doubt in the wheels, and has no
    use for size, people and sampler.
    """

    levels: int = param(12, "", "nodes on the path", low=1, high=MOST_LEVELS)
    particles: int = param(5000, "", "particles of the root", low=1, high=1e7)
    halving: bool = param(True, "", "whether a node has half the particles of the one above")
    floor: int = param(100, "", "particles of a node at least, if so", low=1, high=1e7)
    zones: bool = param(False, "", "whether particles only say in which half they are")
    points: int = param(64, "", "poses that stand for a zone, if so", low=1, high=1e5)
    inherited: float = param(
        0.8, "", "share of a node that is new or come back to, from the one above", low=0, high=1
    )
    margin: float = param(
        0.3, "m", "how near to their region nodes keep poses outside", low=1e-6, high=100
    )
    margin_heading: float = param(0.3, "rad", "the same for headings", low=1e-6, high=math.pi)
    power: float = param(
        0.3, "", "of the likelihood, in virtual low-resolution sensors", above=0, high=1
    )

    def compose(self, models: Models) -> HierarchicalMCL:
        domain = Boxes.of_map(models.grid, models.environment)
        margin = np.array([self.margin, self.margin, self.margin_heading])
        full: Description = FullStates(domain, margin)
        forward = Renewed(Forward(models.resampler), self.random)
        return HierarchicalMCL(
            models.motion,
            models.sensor,
            domain,
            ZoneOnly(domain, self.points) if self.zones else full,
            Halving(particles=self.particles, floor=self.floor)
            if self.halving
            else Equal(particles=self.particles),
            lambda n: (Part(1.0, forward, Fixed(n)),),
            Sensing(self._from_afar),
            self,
            self.levels,
            self.inherited,
            NoRandomParticles(*models.recovery.rates, doubt_below=0.0),
        )

    def _from_afar(self, sensor: SensorModel, region: Region) -> LowResolution:
        return LowResolution(sensor, self.power)
