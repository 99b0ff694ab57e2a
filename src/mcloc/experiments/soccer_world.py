"""A robot on a soccer field that sees landmarks and has no odometry, and a hierarchy that localizes
it  [Est §1, §2].
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws
from mcloc.environment import Box
from mcloc.experiments.tile_world import NEVER, parts_of
from mcloc.filters.hierarchical.description import FullStates
from mcloc.filters.hierarchical.domain import Boxes
from mcloc.filters.hierarchical.hierarchical_mcl import HierarchicalMCL
from mcloc.filters.hierarchical.node import Equal
from mcloc.filters.hierarchical.region import Region
from mcloc.filters.hierarchical.sensing import Sensing
from mcloc.filters.hierarchical.techniques import Techniques
from mcloc.maps.landmarks import Landmarks
from mcloc.motion.max_distance import MaxDistanceMotion
from mcloc.sensors.landmarks import LandmarkModel
from mcloc.sensors.low_resolution import LowResolution
from mcloc.simulation.soccer import FOUR_LEGGED, SPEED, TURN, drive, seen
from mcloc.statespace import SE2

INTERVAL = 0.5  # s
LEVELS = 9  # down to 0.68 m × 0.45 m × 45°
HALF = np.array([FOUR_LEGGED.half_length, FOUR_LEGGED.half_width, np.pi])
POWER = 0.3  # of the likelihood, in virtual low-resolution sensors
PARTICLES = 100  # of each node
BEARING = 0.05  # rad, as the camera errs

WORLD = f"""
A four-legged robot walks from one random place to the next on a field of 5.4 m × 3.6 m, and every
{INTERVAL:g} s sees the beacons and goals that are in view of its turning head, each with a range
(10 % off) and a bearing ({BEARING:g} rad). There is no odometry: the motion model is the paper's,
anywhere that {SPEED:g} m/s and {TURN:g} rad/s lead to, over poses with heading. The tree has
{LEVELS} levels of nodes with {PARTICLES} particles each. Virtual low-resolution sensors are the
likelihood to the power of {POWER:g}; it is positive everywhere as it is, since any range or bearing
may be an outlier.
"""


def soccer_filter(techniques: Techniques) -> HierarchicalMCL:
    """Hierarchical MCL over the poses on the field."""
    environment = Box(tuple(-HALF), tuple(HALF))
    domain = Boxes(Region(SE2, -HALF, HALF), environment)
    motion = MaxDistanceMotion(speed=SPEED, turn_rate=TURN)
    far, turn = motion.reach(INTERVAL)
    return HierarchicalMCL(
        motion,
        LandmarkModel(Landmarks.numbered(FOUR_LEGGED.places), sigma_bearing=BEARING),
        domain,
        FullStates(domain, np.array([far, far, turn])),
        Equal(particles=PARTICLES),
        lambda n: parts_of(n, techniques.random),
        Sensing(lambda sensor, region: LowResolution(sensor, POWER)),
        techniques,
        LEVELS,
        0.0,
        NEVER,
    )


def walked(
    filter: HierarchicalMCL, seed: int, steps: int, carried_off: int
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64], Any]]:
    """(3,) the true pose, (2,) the place that is believed in, m, and the belief, after each step.

    carried_off: after so many steps the robot goes on from somewhere else.
    """
    rng = np.random.default_rng(seed)
    before, after = (drive(2 * seed + k, steps, INTERVAL)[1:] for k in range(2))
    bel = filter.start(filter.environment, Draws(seed))
    for k in range(1, steps + 1):
        pose = (before if k < carried_off else after)[k - 1]
        bel, _ = filter.step(bel, INTERVAL, seen(pose, rng), Draws(seed, k))
        found = filter.query(bel).particles or bel.particles
        yield pose, found.states[:2] @ found.weights, bel
