"""An object in 3-D space that one camera sees from a robot which drives around it: the world of E8,
E9 and E10  [Fox01 §19.3.1, Fig. 19.9–19.11].
"""

import time
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mcloc.density_tree import DensityTree
from mcloc.draws import Draws
from mcloc.environment import Box
from mcloc.errors import FilterError
from mcloc.experiments.comparisons import Errors
from mcloc.experiments.table import Record, Setting, Table, Value
from mcloc.filters.particle_filter import Part, ParticleFilter
from mcloc.filters.recovery import NoRandomParticles
from mcloc.motion.relative import RelativeMotion
from mcloc.particles import Particles
from mcloc.proposals.dual import Dual
from mcloc.proposals.forward import Forward
from mcloc.proposals.predictive import BackwardTree, ForwardTree, Pairs, Way
from mcloc.resampling import Systematic
from mcloc.sample_size import Fixed
from mcloc.samplers.camera_ray import CameraRay
from mcloc.sensors.image_bearing import ImageBearing, Look
from mcloc.statespace import R3

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PLACES = Box((1.0, -2.5, -1.5), (7.0, 2.5, 1.5))  # m ahead, left and up of the camera
MIDDLE = np.mean([PLACES.low, PLACES.high], axis=0)
WITHIN = (3.0, -1.0, -0.7), (5.0, 1.0, 0.7)  # m; where the object is at first
STEPS, RADIUS = 100, 4.0  # once around what is 4 m ahead, which stays ahead
TURN = -2.0 * np.pi / STEPS
MOVE = np.array([RADIUS * (1.0 - np.cos(TURN)), -RADIUS * np.sin(TURN), TURN])
FIELD = 1.2  # rad across the image
NOISES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)  # of the image's width
INTERVAL = 0.2  # s from step to step: the 20,740 images in 4,000 s of [Fox01 Fig. 19.14]
PHI = 0.1
ZERO = 1e-12  # of the largest weight; what weighs less weighs nothing

WORLD = """
The world is this study's own, for the paper says of its simulation only that a robot localizes an
object in 3-D space from the imagery of one camera:

- The robot drives once around a point 4 m ahead of it, in 100 steps, and looks at it all the while.
  The object is up to 1 m to each side of that point, and up to 0.7 m above or below. It may be
  anywhere in a box of 6 m × 5 m × 3 m, over which the samples are spread at first. How far it is
  follows from parallax alone.
- The camera's image is 1.2 rad wide. It shows in which direction the object is, with an error of
  *noise* times the image's width in both coordinates; where that leads out of the image nothing is
  seen, which the sensor model knows.
- At each step the object moves in the robot's frame as the wheels say, with an error of *moved_mm*
  along each axis. The motion model has the same error.
- The figure is the distance from the mean of the samples to the object after 100 steps. Runs of a
  seed have the same object and the same errors, scaled. A filter that has no weight left knows
  nothing: its estimate is the middle of the box, and *failed* counts it.
- All sets are resampled in each step. There are neither random particles nor doubt in the wheels.
"""


def tree(particles: Particles) -> DensityTree:
    """Without a floor, which would be random particles."""
    return DensityTree.fit(particles, R3, floor=0.0)


def resampled_tree(particles: Particles) -> DensityTree:
    """The same of a resampled set, by a comb that needs no chance: leaves hold a number of samples,
    so they are then small where the belief is, rather than where samples were tried.
    """
    n = len(particles)
    chosen = np.searchsorted(np.cumsum(particles.weights), (np.arange(n) + 0.5) / n)
    return tree(Particles.equal(particles.states[:, np.minimum(chosen, n - 1)]))


FILTERS: Mapping[str, tuple[float, Way | None]] = {
    "MCL": (0.0, None),
    "mixture": (PHI, BackwardTree(fit=tree)),
    "mixture, resampled": (PHI, BackwardTree(fit=resampled_tree)),
    "mixture, approach 2": (PHI, ForwardTree(fit=tree)),
    "mixture, approach 1": (PHI, Pairs()),
    "dual": (1.0, BackwardTree(fit=tree)),
    "dual, resampled": (1.0, BackwardTree(fit=resampled_tree)),
}
"""Share of the dual proposal, and its way to weigh: approach 3 unless the name says otherwise."""


def drive(noise: float, moved: float, seed: int) -> Iterator[tuple[NDArray[np.float64], Look]]:
    """(3,) the object and what is seen of it after each step. moved: metres a step and axis."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(*WITHIN)
    back = np.array([[np.cos(TURN), np.sin(TURN)], [-np.sin(TURN), np.cos(TURN)]])
    half = np.array(ImageBearing(field_of_view=FIELD).half)
    for _ in range(STEPS):
        x = np.append(back @ (x[:2] - MOVE[:2]), x[2]) + moved * rng.standard_normal(3)
        z = x[1:] / x[0] + noise * 2.0 * half[0] * rng.standard_normal(2)
        yield x, z if (np.abs(z) <= half).all() else None


def filter_named(name: str, samples: int, noise: float, moved: float) -> ParticleFilter:
    """One of FILTERS, which believes in this noise. moved: metres a step and axis."""
    phi, way = FILTERS[name]
    sensor = ImageBearing(noise=noise, field_of_view=FIELD, p_detect=1.0)
    few = round(phi * samples)
    parts = [Part(1.0 - phi, Forward(Systematic()), Fixed(samples - few))] if few < samples else []
    if way is not None:
        # A group of its own: a fixed share of the belief, as in the paper.
        parts.append(Part(phi, Dual(CameraRay(sensor, PLACES), way), Fixed(few), group=1))
    motion, recovery = RelativeMotion(sigma=moved), NoRandomParticles(doubt_below=0.0)
    return ParticleFilter(motion, sensor, PLACES, tuple(parts), recovery, R3)


def localized(
    name: str, samples: int, noise: float, moved: float, seed: int, believed: float | None = None
) -> Record:
    """What one drive shows of a filter. believed: the noise of its model, None for the true one.

    error_m: after all steps. nothing_m: of the middle of the box. failed: whether the filter had no
    weight left. zeros: the share of the dual samples' weights that are 0 or below 1e-12 of their
    largest, from the second step on, None for MCL. faster: than real time; reads a clock.
    """
    robot = filter_named(name, samples, believed or noise, moved)
    few = sum(part.size.fixed or 0 for part in robot.parts if isinstance(part.proposal, Dual))
    driven = list(drive(noise, moved, seed))
    bel = robot.start(robot.environment, Draws(seed))
    estimate, failed = MIDDLE, False
    zeros, took = [], []
    try:
        for step, (_, z) in enumerate(driven, 1):
            began = time.process_time()
            bel, _ = robot.step(bel, MOVE, z, Draws(seed, step))
            took.append(time.process_time() - began)
            if few and step > 1:  # at the first one all that agree with z weigh the same
                zeros.append(weightless(bel.particles.weights[-few:]))
        estimate = bel.particles.states @ bel.particles.weights
    except FilterError:
        failed = True
    truth = driven[-1][0]
    return {
        "error_m": float(np.linalg.norm(estimate - truth)),
        "nothing_m": float(np.linalg.norm(MIDDLE - truth)),
        "failed": failed,
        "zeros": float(np.mean(zeros)) if zeros else None,
        "faster": INTERVAL / float(np.median(took)),
    }


def weightless(weights: NDArray[np.float64]) -> float:
    """The share of weights that are 0, or as good as 0 beside the largest."""
    return float(np.mean(weights <= ZERO * weights.max()))


def errors(table: Table, metric: str = "error_m", **setting: Value) -> Errors:
    """(noises, seeds): a metric; a seed of which a run raised is left out of all."""
    chosen = table.where(**setting)
    of_noise = [
        {row.seed: row.record[metric] for row in chosen.where(noise=noise).rows if row.record}
        for noise in chosen.values("noise")
    ]
    seeds = sorted(set.intersection(*map(set, of_noise)))
    return np.array([[found[seed] for seed in seeds] for found in of_noise], dtype=np.float64)


def pairs(table: Table, a: Setting, b: Setting) -> dict[str, tuple[Errors, Errors]]:
    """The errors in two settings, seed by seed, at each noise and error of the wheels that both
    have.
    """
    found = {}
    for moved in table.values("moved_mm"):
        for noise in NOISES:
            where = {"moved_mm": moved, "noise": noise}
            one, other = {**where, **a}, {**where, **b}
            if len(table.where(**one)) and len(table.where(**other)):
                found[f"{moved} mm, {percent(noise)}"] = table.paired("error_m", one, other)
    return found


def percent(noise: float) -> str:
    """Such as 10 %."""
    return f"{100.0 * noise:g} %"


def draw_curve(axes: "Axes", table: Table, **look: Any) -> None:
    """Mean error over the noise, in cm, with 95 % intervals."""
    found = 100.0 * errors(table)
    axes.errorbar(
        [100.0 * float(noise) for noise in table.values("noise")],
        found.mean(axis=1),
        yerr=1.96 * found.std(axis=1) / np.sqrt(found.shape[1]),
        **{"fmt": "o-", "ms": 4, "lw": 1.5, "capsize": 2, **look},
    )


def finish_axes(axes: "Axes", moved_mm: Value) -> None:
    """Scales and a title for one error of the wheels."""
    ticks = [100.0 * noise for noise in NOISES]
    axes.set(xscale="log", yscale="log", title=f"wheels err by {moved_mm} mm a step")
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    heights = (2, 5, 10, 20, 50, 100, 200)
    axes.set_yticks(heights, [str(height) for height in heights])
    axes.set_ylim(heights[0], heights[-1])
    axes.minorticks_off()
    axes.grid(alpha=0.3)
