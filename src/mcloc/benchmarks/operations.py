"""What is measured: each operation as mcloc does it, and as the reference does the same work."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt

from mcloc.benchmarks import reference, reference_filter
from mcloc.benchmarks.reference import Table
from mcloc.benchmarks.scene import MOVE, RANGE_MAX, SEED, Scene
from mcloc.density_tree import DensityTree, leaf_size
from mcloc.draws import Draws
from mcloc.estimate import hypotheses
from mcloc.filters.catalog import Composition
from mcloc.filters.particle_filter import ParticleBelief, ParticleFilter
from mcloc.kernels.distance import squared_distance
from mcloc.maps.cell_table import CellTable
from mcloc.motion.odometry import OdometryMotion
from mcloc.particles import Particles
from mcloc.resampling import Systematic
from mcloc.sample_size.kld import KLD
from mcloc.sensors.beam_presets import FourPartBeams
from mcloc.sensors.likelihood_field import LikelihoodField
from mcloc.statespace import SE2

DRAWS = Draws(SEED, 2)


@dataclass(frozen=True)
class Work:
    """ours, reference: the same work, each from the same data. units: what it is counted in."""

    ours: Callable[[], Any]
    reference: Callable[[], Any]
    units: int


@dataclass(frozen=True, eq=False)
class Case:
    """A scene, a cloud of a name in it, n particles, and how many beams a scan has."""

    scene: Scene
    cloud: str
    n: int
    beams: int

    @property
    def states(self) -> Any:
        return self.scene.cloud(self.cloud, self.n)


def likelihood_field(case: Case) -> Work:
    sensor = LikelihoodField(case.scene.grid, max_beams=case.beams)
    x, z = case.states, case.scene.scan(case.beams)
    table, points, beta = _table(sensor.table), sensor.endpoints(z), sensor.tempering(z)
    return Work(
        lambda: sensor.log_likelihood(x, z),
        lambda: beta * reference.sum_over_points(x, points, table),
        case.n * case.beams,
    )


def beam_cast(case: Case) -> Work:
    sensor = FourPartBeams(case.scene.grid, max_beams=case.beams)
    x, z = case.states, case.scene.scan(case.beams)

    def by_numpy() -> Any:
        table = sensor.log_table(z.ranges, RANGE_MAX).astype(np.float64)
        lengths = reference.cast(case.scene.grid, sensor.sigma_hit, x, z.mount, z.angles, RANGE_MAX)
        return sensor.tempering(z) * reference.interpolated(lengths, table, sensor.spacing)

    return Work(lambda: sensor.log_likelihood(x, z), by_numpy, case.n * case.beams)


def beam_table(case: Case) -> Work:
    sensor = FourPartBeams(case.scene.grid, max_beams=case.beams, ranges="table")
    x, z = case.states, case.scene.scan(case.beams)
    looked_up = sensor.range_table
    row_of, rows = looked_up.rows
    height, width, left, bottom, *_ = looked_up.caster.frame
    cells = Table(
        row_of.reshape(height, width).astype(np.float64), (left, bottom), case.scene.grid.resolution
    )
    log_p = sensor.log_of_knots(RANGE_MAX)[sensor.nearest_knots(z.ranges, RANGE_MAX)]
    by_angle, in_double = rows.reshape(-1, looked_up.angles), log_p.astype(np.float64)

    def by_numpy() -> Any:
        total = reference.looked_up(x, z.mount, z.angles, by_angle, cells, in_double)
        return sensor.tempering(z) * total

    return Work(lambda: sensor.log_likelihood(x, z), by_numpy, case.n * case.beams)


def motion(case: Case) -> Work:
    x, model, rng = case.states, OdometryMotion(), np.random.default_rng(SEED)
    drive = _drive(model)
    return Work(
        lambda: model.sample(x, MOVE, DRAWS, 0), lambda: reference.moved(x, drive, rng), case.n
    )


def resample(case: Case) -> Work:
    particles, rng = _weighed(case), np.random.default_rng(SEED)
    return Work(
        lambda: Systematic()(particles, case.n, DRAWS).of(0, case.n),
        lambda: reference.systematic(particles.weights, rng.random(), case.n),
        case.n,
    )


def kld_count(case: Case) -> Work:
    x, rule, none = case.states, KLD(minimum=1, maximum=10_000_000), np.zeros(case.n)
    return Work(
        lambda: rule.counter(SE2, 0, 0).enough(x, none),
        lambda: reference.kld_size(x, _sides(rule), rule.epsilon, rule.delta, (1, 10_000_000)),
        case.n,
    )


def estimate(case: Case) -> Work:
    particles = _weighed(case)
    return Work(
        lambda: hypotheses(particles, SE2),
        lambda: reference_filter.hypotheses(particles.states, particles.weights),
        case.n,
    )


def step_fixed(case: Case) -> Work:
    mcl = _mcl(case, size="fixed", settings={"size": {"particles": case.n}})
    bel, z = ParticleBelief(_weighed(case)), case.scene.scan(case.beams)
    model, rng = _model(mcl, case), np.random.default_rng(SEED)
    weights = bel.particles.weights
    return Work(
        lambda: _stepped(mcl, bel, z),
        lambda: reference_filter.step_fixed(bel.particles.states, weights, model, rng),
        case.n,
    )


def step_adaptive(case: Case) -> Work:
    mcl = _mcl(case, size="kld", settings={})
    bel, z, rule = ParticleBelief(_weighed(case)), case.scene.scan(case.beams), mcl.parts[0].size
    assert isinstance(rule, KLD)
    model, rng = _model(mcl, case), np.random.default_rng(SEED)
    weights, bounds = bel.particles.weights, (rule.epsilon, rule.delta)
    limits = rule.minimum, rule.maximum
    drawn = mcl.step(bel, MOVE, z, DRAWS)[1].n
    return Work(
        lambda: _stepped(mcl, bel, z),
        lambda: reference_filter.step_adaptive(
            *(bel.particles.states, weights, model, rng, _sides(rule), bounds, limits)
        ),
        drawn,
    )


def distance_transform(case: Case) -> Work:
    walls = case.scene.grid.occupied
    return Work(lambda: squared_distance(walls), lambda: distance_transform_edt(~walls), walls.size)


def density_tree(case: Case) -> Work:
    particles, places = _weighed(case), case.scene.cloud(case.cloud, case.n)
    leaf = leaf_size(case.n, 3)
    return Work(
        lambda: DensityTree.fit(particles, SE2).log_density(places),
        lambda: reference_filter.density_tree(particles.states, particles.weights, places, leaf),
        case.n,
    )


OPERATIONS: dict[str, Callable[[Case], Work]] = {
    made.__name__: made
    for made in (
        *(likelihood_field, beam_cast, beam_table, motion, resample, kld_count, estimate),
        *(step_fixed, step_adaptive, distance_transform, density_tree),
    )
}
WITHOUT_BEAMS = {motion, resample, kld_count, estimate, distance_transform, density_tree}
WITHOUT_PARTICLES = {distance_transform}


def _weighed(case: Case) -> Particles:
    """Weights as after a scan that tells little: e^N(0, ½²)."""
    logs = 0.5 * np.random.default_rng(SEED + 1).standard_normal(case.n)
    return Particles.normalized(case.states, logs)


def _mcl(case: Case, **chosen: Any) -> ParticleFilter:
    settings = {**chosen.pop("settings"), "sensor": {"max_beams": case.beams}}
    composition = Composition("mcl", recovery="none", settings=settings, **chosen)
    mcl = composition.build(case.scene.grid)
    assert isinstance(mcl, ParticleFilter)
    return mcl


def _stepped(mcl: ParticleFilter, bel: ParticleBelief, z: Any) -> Any:
    after, info = mcl.step(bel, MOVE, z, DRAWS)
    return hypotheses(after.particles, mcl.space), info.ess, info.evidence


def _model(mcl: ParticleFilter, case: Case) -> reference_filter.Model:
    sensor, floor, z = mcl.sensor, case.scene.floor, case.scene.scan(case.beams)
    assert isinstance(sensor, LikelihoodField)
    assert isinstance(mcl.motion, OdometryMotion)
    return reference_filter.Model(
        _table(sensor.table),
        _table(floor.table),
        sensor.endpoints(z),
        sensor.tempering(z),
        sensor.readings(z),
        _drive(mcl.motion),
    )


def _drive(model: OdometryMotion) -> tuple[float, ...]:
    d = model.decompose(MOVE)
    return d.rot1, d.trans, d.rot2, d.sd_rot1, d.sd_trans, d.sd_rot2


def _sides(rule: KLD) -> Any:
    return np.array([rule.bin_length, rule.bin_length, rule.bin_angle])


def _table(of_cells: CellTable) -> Table:
    """In double precision, and not rounded to 16 bits once more."""
    _, _, left, bottom, *_ = of_cells.frame
    values = of_cells.largest - of_cells.step * of_cells.codes.astype(np.float64)
    return Table(values, (left, bottom), of_cells.grid.resolution)
