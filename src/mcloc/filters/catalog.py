"""Filters by name: each a composition of the same parts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, cast

from mcloc.environment import ENVIRONMENTS
from mcloc.errors import ConfigError, MapError
from mcloc.events import BeaconRanges, Image, Measurement, Message, Scan, Sightings
from mcloc.filters.filter import Filter
from mcloc.filters.grid_proposal import GridProposal
from mcloc.filters.hierarchical.kind import Hierarchical
from mcloc.filters.kalman import Kalman
from mcloc.filters.markov_grid import MarkovGrid
from mcloc.filters.models import FilterKind, Models
from mcloc.filters.octree import Octree
from mcloc.filters.particle_filter import Part, ParticleFilter
from mcloc.filters.people import PEOPLE
from mcloc.filters.recovery import RECOVERIES, WithoutRandomParticles
from mcloc.filters.sensor_resetting import SensorResetting
from mcloc.filters.topological import Topological
from mcloc.maps.beacons import Beacons
from mcloc.maps.landmarks import Landmarks
from mcloc.maps.mosaic import Mosaic
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.maps.teammates import Teammates
from mcloc.motion import MOTIONS
from mcloc.proposals.dual import Dual
from mcloc.proposals.forward import Forward
from mcloc.proposals.mixture import Mixture
from mcloc.proposals.predictive import ForwardTree
from mcloc.proposals.relocating import Relocating
from mcloc.protocols import Environment, MotionModel, PoseSampler, SensorModel
from mcloc.registry import Configurable, Registry, Value, param, suggest
from mcloc.resampling import RESAMPLERS
from mcloc.sample_size import SIZES, Fixed
from mcloc.sample_size.split import Split
from mcloc.samplers import SAMPLERS
from mcloc.samplers.beacon_circles import BeaconCircles
from mcloc.samplers.ceiling_index import CeilingIndex
from mcloc.samplers.fused import FusedSampler
from mcloc.samplers.landmark_circles import LandmarkCircles
from mcloc.samplers.message_poses import MessagePoses
from mcloc.sensors import CAMERAS, MESSAGES, RANGINGS, SENSORS, SIGHTINGS
from mcloc.sensors.fused import Fused


@dataclass(frozen=True)
class MCL(Configurable):
    """Monte Carlo localization [Fox01 §19.2.3; Fox99]."""

    def compose(self, models: Models) -> ParticleFilter:
        return models.filter(Part(1.0, Forward(models.resampler), models.size))


@dataclass(frozen=True)
class MixtureMCL(Configurable):
    """MCL with mixture proposal [Fox01 §19.3.3]: at a global start the particles come from the
    first scan, and while recovery asks for random ones a share of them does.

    From then on until it is sure of one place it searches, and keeps unlikely places. With recovery
    `random` it looks at each scan, and the share of the belief is `carried_off` at most.
    """

    phi: float = param(
        0.5, "", "share from the scan where the robot may be anywhere", above=0, high=0.99
    )
    particles: int = param(5000, "", "particles while it searches", low=1, high=1e7)
    carried_off: float = param(
        0.01, "", "P(carried off since the last update), where it seems lost", above=0, high=0.99
    )

    def compose(self, models: Models) -> ParticleFilter:
        proposal = Relocating(
            models.sampler(), models.resampler, self.phi, self.particles, self.carried_off
        )
        composed = models.filter(Part(1.0, proposal, models.size))
        return replace(composed, anywhere=Fixed(self.particles))


@dataclass(frozen=True)
class BalancedMixtureMCL(Configurable):
    """MCL with mixture proposal under one density: each particle is weighed by (1 − φ) q + φ q̄, q̄
    by a density tree of what was believed (approach 2) [Fox01 §19.3.3].

    While nothing makes it search it does what MCL does.
    """

    phi: float = param(0.5, "", "share from the scan while it searches", above=0, high=0.99)

    def compose(self, models: Models) -> ParticleFilter:
        proposal = Mixture(models.sampler(), models.resampler, self.phi)
        return models.filter(Part(1.0, proposal, models.size))


@dataclass(frozen=True)
class GroupedMixtureMCL(Configurable):
    """MCL with mixture proposal as in the papers: at each step a share φ of the belief comes from
    the scan, whatever it is worth, weighed by a density tree of what was believed (approach 2)
    [Fox01 §19.3.3].

    Of `particles` in all a share φ, by chance, is drawn from the scan; the size is not asked.
    """

    phi: float = param(0.1, "", "share of the belief from the scan", above=0, high=0.99)
    particles: int = param(5000, "", "particles", low=2, high=1e7)

    def compose(self, models: Models) -> ParticleFilter:
        forward, dual = (
            Split(particles=self.particles, phi=self.phi, rest=rest) for rest in (True, False)
        )
        return models.filter(
            Part(1.0 - self.phi, Forward(models.resampler), forward),
            Part(self.phi, Dual(models.sampler(), ForwardTree()), dual, group=1),
        )


@dataclass(frozen=True)
class SensorResettingMCL(Configurable):
    """MCL with sensor resetting: poses from the scan instead of random particles, in the share that
    recovery asks for, with equal weights [Lenser, Veloso: ICRA 2000].
    """

    def compose(self, models: Models) -> ParticleFilter:
        mcl = models.filter(Part(1.0, Forward(models.resampler), models.size))
        steps = {f.name: getattr(mcl, f.name) for f in fields(mcl)}
        steps["recovery"] = WithoutRandomParticles(models.recovery)
        return SensorResetting(**steps, sampler=models.sampler(), resetting=models.recovery)


FILTERS: Registry[FilterKind] = Registry(
    "filter",
    {
        "mcl": MCL,
        "mixture": MixtureMCL,
        "mixture-balanced": BalancedMixtureMCL,
        "mixture-grouped": GroupedMixtureMCL,
        "sensor-resetting": SensorResettingMCL,
        "markov-grid": MarkovGrid,
        "octree": Octree,
        "hierarchical": Hierarchical,
        "grid-proposal": GridProposal,
        "kalman": Kalman,
        "topological": Topological,
    },
)

REGISTRIES: dict[str, Registry[Any]] = {
    "filter": FILTERS,
    "motion": MOTIONS,
    "sensor": SENSORS,
    "environment": ENVIRONMENTS,
    "size": SIZES,
    "resampler": RESAMPLERS,
    "recovery": RECOVERIES,
    "people": PEOPLE,
    "sampler": SAMPLERS,
    "sightings": SIGHTINGS,
    "ranging": RANGINGS,
    "camera": CAMERAS,
    "message": MESSAGES,
}


@dataclass(frozen=True)
class Aid:
    """What else than walls a robot can be localized by. kind: of the parts that model what tells of
    it. measures: what these tell. sampler: of poses from it, by such a model and where a
    robot can be.
    """

    kind: str
    measures: type[Measurement]
    sampler: Callable[[Any, Environment], PoseSampler]


AIDS: Mapping[type, Aid] = {
    Landmarks: Aid("sightings", Sightings, LandmarkCircles),
    Mosaic: Aid("camera", Image, CeilingIndex),
    Beacons: Aid("ranging", BeaconRanges, BeaconCircles),
    Teammates: Aid("message", Message, MessagePoses),
}
"""By the map of them."""


@dataclass(frozen=True)
class Composition:
    """A filter described by names. settings: {kind: {parameter: value}}, kinds as in REGISTRIES."""

    filter: str = "mixture"
    motion: str = "odometry"
    sensor: str = "likelihood-field"
    environment: str = "free-space"
    size: str = "kld"
    resampler: str = "systematic"
    recovery: str = "augmented"
    people: str = "none"
    sampler: str = "grid-match"
    sightings: str = "landmarks"
    ranging: str = "beacons"
    camera: str = "ceiling-patch"
    message: str = "density-tree"
    settings: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)

    def build(self, grid: OccupancyGrid, *aids: Any) -> Filter[Any]:
        """The filter on a map, with maps of what else sensors see there, of the types in AIDS.
        Raises ConfigError for unknown names and values that cannot be right.
        """
        for kind in self.settings:
            if kind not in REGISTRIES:
                raise ConfigError(f"unknown part {kind!r}; {suggest(kind, REGISTRIES)}")
        composed: FilterKind = self._part("filter")
        environment = self._part("environment", grid)
        sensor = self._sensor(grid, aids)
        return composed.compose(
            Models(
                grid=grid,
                motion=self._part("motion"),
                sensor=sensor,
                environment=environment,
                size=self._part("size"),
                resampler=self._part("resampler"),
                recovery=self._part("recovery"),
                people=self._part("people", grid),
                sampler=lambda: self._sampler(grid, sensor, environment),
            )
        )

    def motion_model(self) -> MotionModel:
        """p(x_t | u_t, x_{t−1}) of the filter."""
        return cast(MotionModel, self._part("motion"))

    def _sensor(self, grid: OccupancyGrid, aids: Sequence[Any]) -> SensorModel:
        """The model of scans; with aids, one of all that the place has something for."""
        if not aids:
            return cast(SensorModel, self._part("sensor", grid))
        for aid in aids:
            if isinstance(aid, Mosaic) and not aid.covers(grid):
                raise MapError(
                    f"{aid.name}: the mosaic lies above no free cell of {grid.name}; both are in "
                    "the map frame: set its resolution and origin"
                )
        models = {AIDS[type(aid)].measures: self._part(AIDS[type(aid)].kind, aid) for aid in aids}
        models.setdefault(Message, self._part("message", Teammates()))  # that nothing was measured
        if grid.occupied.any():
            models[Scan] = self._part("sensor", grid)
        return Fused(models)

    def _sampler(
        self, grid: OccupancyGrid, sensor: SensorModel, environment: Environment
    ) -> PoseSampler:
        if not isinstance(sensor, Fused):
            return cast(PoseSampler, self._part("sampler", grid, sensor, environment))
        models = dict(sensor.models)
        samplers: dict[type[Measurement], PoseSampler] = {
            aid.measures: aid.sampler(models[aid.measures], environment)
            for aid in AIDS.values()
            if aid.measures in models
        }
        if Scan in models:
            samplers[Scan] = self._part("sampler", grid, models[Scan], environment)
        return FusedSampler(samplers)

    def _part(self, kind: str, *bound: object) -> Any:
        return REGISTRIES[kind].make(getattr(self, kind), *bound, **self.settings.get(kind, {}))
