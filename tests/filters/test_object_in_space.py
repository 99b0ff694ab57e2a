"""MCL, and MCL with a mixture of proposals, on an object in space that a camera sees from a robot
which drives once around it  [Fox01 §19.3.1, Fig. 19.9, 19.10].
"""

from functools import cache

import numpy as np
import pytest

from mcloc.density_tree import DensityTree
from mcloc.draws import Draws
from mcloc.environment import Box
from mcloc.errors import FilterError
from mcloc.filters.particle_filter import Part, ParticleFilter
from mcloc.motion.relative import RelativeMotion
from mcloc.proposals.dual import Dual
from mcloc.proposals.forward import Forward
from mcloc.proposals.predictive import BackwardTree, ForwardTree
from mcloc.resampling import Systematic
from mcloc.sample_size import Fixed
from mcloc.samplers.camera_ray import CameraRay
from mcloc.sensors.image_bearing import ImageBearing
from mcloc.statespace import R3

PLACES = Box((1.0, -2.5, -1.5), (7.0, 2.5, 1.5))
STEPS, RADIUS = 100, 4.0
TURN = -2.0 * np.pi / STEPS
MOVE = np.array([RADIUS * (1.0 - np.cos(TURN)), -RADIUS * np.sin(TURN), TURN])
MOVED = 0.001  # m a step and axis
FIELD = 1.2  # rad


def drive(noise, seed):
    """Object and measurement at each step, by geometry of its own."""
    rng = np.random.default_rng(seed)
    x = rng.uniform((3.0, -1.0, -0.7), (5.0, 1.0, 0.7))
    back = np.array([[np.cos(TURN), np.sin(TURN)], [-np.sin(TURN), np.cos(TURN)]])
    width = 2.0 * np.tan(0.5 * FIELD)
    for _ in range(STEPS):
        x = np.append(back @ (x[:2] - MOVE[:2]), x[2]) + MOVED * rng.standard_normal(3)
        z = x[1:] / x[0] + noise * width * rng.standard_normal(2)
        yield x, z if (np.abs(z) <= 0.5 * width * np.array([1.0, 0.75])).all() else None


def tree(particles):
    return DensityTree.fit(particles, R3, floor=0.0)


def built(way, noise, n):
    sensor = ImageBearing(noise=noise, field_of_view=FIELD, p_detect=1.0)
    forward, few = Forward(Systematic()), n // 10
    parts = (Part(1.0, forward, Fixed(n)),)
    if way is not None:
        dual = Dual(CameraRay(sensor, PLACES), way(fit=tree))
        parts = Part(0.9, forward, Fixed(n - few)), Part(0.1, dual, Fixed(few), group=1)
    return ParticleFilter(RelativeMotion(sigma=MOVED), sensor, PLACES, parts, space=R3)


@cache
def errors(way, noise, repeats, n=1000):
    """(repeats,): metres from the mean to the object after all steps. A filter that has no weight
    left knows nothing: its estimate is the middle of the box.
    """
    found = np.empty(repeats)
    for seed in range(repeats):
        robot = built(way, noise, n)
        bel = robot.start(PLACES, Draws(seed))
        driven = list(drive(noise, seed))
        try:
            for step, (_, z) in enumerate(driven, 1):
                bel, _ = robot.step(bel, MOVE, z, Draws(seed, step))
            estimate = bel.particles.states @ bel.particles.weights
        except FilterError:
            estimate = np.mean([PLACES.low, PLACES.high], axis=0)
        found[seed] = np.linalg.norm(estimate - driven[-1][0])
    return found


def certainly_above(some, others):
    """Whether the mean is larger, by 2 standard errors."""
    error = np.sqrt(some.var() / len(some) + others.var() / len(others))
    return some.mean() - others.mean() > 2.0 * error


@pytest.mark.parametrize("noise", [0.1, 0.2])
def test_mcl_finds_the_object(noise):
    """The middle of the box is 0.9 m off; range follows from parallax alone."""
    assert errors(None, noise, 40).mean() < 0.5


def test_mcl_is_worse_with_a_precise_sensor():
    """Two of 1,000 particles are as near to the first ray as 1 % noise asks for, and the range that
    they happen to have is kept: wheels that err by 1 mm hardly move it.
    """
    assert certainly_above(errors(None, 0.01, 40), errors(None, 0.1, 40))


@pytest.mark.slow
@pytest.mark.parametrize("way", [ForwardTree, BackwardTree])
def test_a_mixture_is_better_with_a_precise_sensor(way):
    assert certainly_above(errors(way, 0.1, 12), errors(way, 0.01, 12))
    assert certainly_above(errors(None, 0.01, 40), errors(way, 0.01, 12))
