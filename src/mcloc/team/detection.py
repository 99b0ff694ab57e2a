"""p(z | x_i, x_j) of robot i seeing robot j, z = (r, b) or (r, b, η):

    (1 − ε) N(r; d, σ_d²) N(b; β, σ_b²) N(η; θ_j − θ_i, σ_η²) + ε / (2 π r_max · 2 π),

d and β the distance and the bearing of j from i's sensor, and what follows from it: where j is by
the belief of i, and i by that of j, as density trees  [Fox01 Eq. 19.4.18, 19.4.19].

Each is a sample set. In the plane dx dy = d dd dφ, so a distance is drawn from d N(r; d, σ_d²). For
the seer they are a ring in x, y, θ: all directions are alike, and in each the bearing says how it
faces.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mcloc.density import FAR
from mcloc.density_tree import DensityTree
from mcloc.draws import Draws, Stream
from mcloc.events import Detection, Message
from mcloc.geometry import compose, wrap
from mcloc.motion.left_invariant import log_wrapped_normal
from mcloc.particles import Particles
from mcloc.registry import Configurable, param
from mcloc.resampling import Systematic
from mcloc.samplers.found_poses import robot_at
from mcloc.samplers.landmark_circles import PEAK, Ring
from mcloc.sensors.messages import message_of
from mcloc.statespace import PLANE, SE2, States, StateSpace

KNOTS = 257  # of the distances within PEAK deviations of a range

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DetectionModel(Configurable):
    """How well one robot sees another.

    The defaults are those of the cameras with lasers of [Fox01 §19.4.2]: a mean error of 48.26 cm,
    which is σ √(2/π), one of 2.2° in bearing, 6.9 % false detections. σ_d² = σ_range² + (σ_relative
    d)². A detection that is false is of any range and bearing, and so says nothing. p_detect and
    fov are for robots that are not seen.
    """

    sigma_range: float = param(0.605, "m", "deviation of a range to 0 m", above=0, high=100)
    sigma_relative: float = param(
        0.0, "m/m", "deviation per distance, in quadrature", low=0, high=10
    )
    sigma_bearing: float = param(0.048, "rad", "deviation of a bearing", above=0, high=2)
    sigma_heading: float = param(0.1, "rad", "deviation of a relative heading", above=0, high=2)
    range_max: float = param(8.0, "m", "longest range that is measured", above=0, high=1e5)
    p_false: float = param(
        0.069, "", "ε: chance that there is no robot where one is seen", above=0, high=0.99
    )
    p_detect: float = param(
        0.0,
        "",
        "chance that a robot in view is seen; 0: that none is seen says nothing",
        low=0,
        high=0.99,
    )
    fov: float = param(
        2.0 * math.pi, "rad", "angle of view, half to each side", above=0, high=2.0 * math.pi
    )
    particles: int = param(
        2500, "", "poses that a belief is taken by when it is told", low=100, high=1e6
    )

    def sigma(self, d: Array) -> Array:
        """σ_d, metres, at a distance d."""
        return np.hypot(self.sigma_range, self.sigma_relative * d)

    def range_density(self, r: Array | float, d: Array) -> Array:
        """N(r; d, σ_d²) per metre, broadcast."""
        sigma = self.sigma(d)
        density: Array = np.exp(-0.5 * ((r - d) / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi))
        return density

    def density(self, z: Detection, seer: States, seen: States) -> Array:
        """(n,): p(z | x_i, x_j) for poses (3, n) of both, of what was measured."""
        sensor = np.ascontiguousarray(compose(seer.T, z.mount).T)
        dx, dy = seen[:2] - sensor[:2]
        true, false = self.range_density(z.range, np.hypot(dx, dy)), 1.0 / self.range_max
        for measured, expected, sigma in (
            (z.bearing, np.arctan2(dy, dx) - sensor[2], self.sigma_bearing),
            (z.heading, seen[2] - sensor[2], self.sigma_heading),
        ):
            if not math.isnan(measured):
                true *= np.exp(log_wrapped_normal(measured - expected, sigma))
                false /= 2.0 * math.pi
        density: Array = (1.0 - self.p_false) * true + self.p_false * false
        return density

    def even(self, z: Detection, space: StateSpace) -> float:
        """What a false detection is worth beside the density of a true one: p(z | false) over the
        integral of p(z | x, true) over the places or poses x of one of the two, per m² or m² rad.
        """
        area = float(_ring(self, z.range).cumulative[-1])  # ∫ d N(r; d, σ_d²) dd
        return 1.0 / (2.0 * math.pi * self.range_max * area) / _headings(space)

    def fault(self, z: Detection) -> str:
        """Why what was measured can be of no use, or nothing."""
        if not (np.abs(z.mount) < FAR).all():
            return "with a mount that cannot be"
        endless = math.isinf(z.bearing) or math.isinf(z.heading)
        within = 0.0 < z.range <= self.range_max and not endless
        return "" if within else "without a range that can be"


def to_seen(seer: Particles, z: Detection, model: DetectionModel, draws: Draws) -> DensityTree:
    """Where the robot that is seen is, by the belief of the one that sees it, at the time of z:
    over x, y, and with a relative heading over x, y, θ.
    """
    drawn = _Drawn(seer, z, model, draws)
    sensor = compose(drawn.poses.T, z.mount).T if z.mount.any() else drawn.poses
    direction = sensor[2] + drawn.bearing
    x, y = sensor[0] + drawn.d * np.cos(direction), sensor[1] + drawn.d * np.sin(direction)
    if math.isnan(z.heading):
        return _tree(np.stack([x, y]))
    return _tree(np.stack([x, y, wrap(sensor[2] + drawn.heading)]))


def to_seer(seen: Particles, z: Detection, model: DetectionModel, draws: Draws) -> DensityTree:
    """Where the robot that sees is, by the belief of the one that is seen, at the time of z: a ring
    in x, y, θ; with a relative heading as far as that of the seen one is known; over x, y where
    neither that nor a bearing was measured.
    """
    drawn = _Drawn(seen, z, model, draws)
    facing = drawn.around if math.isnan(z.heading) else drawn.poses[2] - drawn.heading
    direction = facing + drawn.bearing  # from the seer
    x, y = drawn.poses[:2] - drawn.d * np.stack([np.cos(direction), np.sin(direction)])
    if math.isnan(z.heading) and math.isnan(z.bearing):
        return _tree(_robot(np.stack([x, y, facing]), z)[:2])
    return _tree(_robot(np.stack([x, y, wrap(facing)]), z))


def _robot(sensor: States, z: Detection) -> States:
    """(3, n): the robots whose sensors are at these poses (3, n)."""
    return robot_at(sensor, z.mount) if z.mount.any() else sensor


def message(z: Detection, tree: DensityTree, model: DetectionModel, source: str) -> Message:
    """What a robot is told by such a tree. source: by whom."""
    even = model.even(z, tree.space)
    return message_of(z.t, tree, source, p_false=model.p_false, even=even)


class _Drawn:
    """Poses (3, n) of a belief, and for each what may be true of a detection: distance d (n,), and
    bearing and relative heading; around (n,): an angle that may be any.
    """

    def __init__(
        self, belief: Particles, z: Detection, model: DetectionModel, draws: Draws
    ) -> None:
        n = model.particles
        ancestors = Systematic()(belief, n, draws).of(0, n)
        self.poses = np.take(belief.states, ancestors, axis=1)
        u, noise = draws.uniform(Stream.TREE, 0, n), draws.normal(Stream.MOTION, 0, n)
        self.d = _ring(model, z.range).distance(u[0])
        self.around = 2.0 * math.pi * u[1]
        self.bearing = z.bearing + model.sigma_bearing * noise[0]
        if math.isnan(z.bearing):
            self.bearing = 2.0 * math.pi * u[2]
        self.heading = z.heading + model.sigma_heading * noise[1]


@lru_cache(maxsize=16)
def _ring(model: DetectionModel, r: float) -> Ring:
    """Of one detection, which is asked for several times: d N(r; d, σ_d²) where it is not 0."""
    reach = PEAK * float(model.sigma(np.array(r)))
    knots = np.linspace(max(r - reach, 0.0), r + reach, KNOTS)
    return Ring(knots, knots * model.range_density(r, knots))


def _tree(states: States) -> DensityTree:
    """Without a floor: that of a message is ε."""
    space = SE2 if len(states) == 3 else PLANE
    return DensityTree.fit(Particles.equal(np.ascontiguousarray(states)), space, floor=0.0)


def _headings(space: StateSpace) -> float:
    """The size of the axis of headings, where there is one."""
    return 2.0 * math.pi if space.dimension == 3 else 1.0
