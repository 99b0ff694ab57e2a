"""q̄(x) = p(z | x) / π(z) of a direction: x = (d, d u, d v) has dx = d² dd du dv, so places along a
ray have density ∝ d², and

    q̄(d, u, v) ∝ [d² A(d) B(d)] [N(u; z_u, σ²) / A(d)] [N(v; z_v, σ²) / B(d)],

A and B the probabilities of what a box shows of its section at depth d  [Fox01 Eq. 19.3.7].

With ρ = d √(1 + u² + v²) along the ray and dΩ = (1 + u² + v²)^(−3/2) du dv, d² dd du dv = ρ² dρ dΩ.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from mcloc.draws import Draws, Stream
from mcloc.environment import Box
from mcloc.errors import ConfigError
from mcloc.protocols import PoseDensity
from mcloc.sensors.image_bearing import NEAREST, ImageBearing, Look
from mcloc.statespace import LogWeights, States

KNOTS = 1024  # between which d² A B is a straight line
LEAST = 1e-300  # probability; below it a direction is as good as impossible

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class CameraRay:
    """Places of an object in a box, from the direction in which a camera sees it.

    Depth is drawn by inversion of a table, then both image coordinates by inversion within what the
    box shows at that depth: no place is rejected. What is drawn is exactly what `log_density` says,
    which differs from p(z | x) / π(z) by the straight lines between the table's knots: at 1 %
    noise by less than 10⁻⁴ of the mass wherever z is, and π(z) by less than 10⁻⁵.

    Where nothing was seen, q̄ is uniform over the box, and so it is where z is so far beside the box
    that p(z | x) is 0 in double precision. Raises ConfigError for a box that is nowhere ahead.
    """

    sensor: ImageBearing
    box: Box

    def __post_init__(self) -> None:
        if self.box.high[0] <= NEAREST:
            raise ConfigError(
                f"a box up to x = {self.box.high[0]} m is nowhere ahead of the camera, which is at "
                "0 and looks along x"
            )

    def given(self, z: Look, draws: Draws) -> PoseDensity:
        """q̄ for one measurement; nothing is drawn for it."""
        if z is None:
            return Unseen(self.box, self._log_pi_unseen)
        if (np.abs(z) > self.sensor.half).any():
            return Unseen(self.box, -math.inf)
        ray = RayDensity(self.sensor, self.box, z)
        return ray if ray.total > LEAST else Unseen(self.box, ray.log_pi)

    @cached_property
    def _log_pi_unseen(self) -> float:
        """log ∫ p(not seen | x) dx, by depth: V − p_detect ∫ d² [∫ P_u du] [∫ P_v dv] dd, P_u the
        probability that the image of a place at u is seen within the image's width.
        """
        depths = depths_of(self.box)
        seen = depths**2
        for low, high, half in sections(self.sensor, self.box, depths):
            seen *= within(high, half, self.sensor.sigma) - within(low, half, self.sensor.sigma)
        unseen = self.box.volume - self.sensor.p_detect * float(np.trapezoid(seen, depths))
        return math.log(max(unseen, LEAST))


@dataclass(frozen=True)
class Unseen:
    """Anywhere in the box."""

    box: Box
    log_pi: float

    def sample(self, draws: Draws, first: int, n: int) -> States:
        """(3, n): places of the particles first … first + n − 1."""
        return self.box.sample(draws, first, n)

    def log_density(self, x: States) -> LogWeights:
        """(n,): log U(x) per m³."""
        return self.box.log_density(x)


@dataclass(frozen=True, eq=False)
class RayDensity:
    """q̄ for an object that was seen at z."""

    sensor: ImageBearing
    box: Box
    z: Reals

    @cached_property
    def depths(self) -> Reals:
        """(K,): the knots, metres ahead."""
        return depths_of(self.box)

    @cached_property
    def by_depth(self) -> Reals:
        """(K,): d² A(d) B(d)."""
        shown = [probability(*limits) for limits in self._limits(self.depths)]
        product: Reals = self.depths**2 * shown[0] * shown[1]
        return product

    @cached_property
    def cumulative(self) -> Reals:
        """(K,): its integral up to each knot."""
        pieces = 0.5 * (self.by_depth[1:] + self.by_depth[:-1]) * np.diff(self.depths)
        return np.concatenate([[0.0], np.cumsum(pieces)])

    @property
    def total(self) -> float:
        """π(z) / p_detect, in m³ per unit of area of the image."""
        return float(self.cumulative[-1])

    @property
    def log_pi(self) -> float:
        """log π(z), to second order in the distance of the knots."""
        return math.log(max(self.total, LEAST) * self.sensor.p_detect)

    def sample(self, draws: Draws, first: int, n: int) -> States:
        """(3, n): places of the particles first … first + n − 1."""
        # The stream is one that mixtures leave to samplers.
        of_depth, of_left, of_up, _ = draws.uniform(Stream.TREE, first, n)
        d = self._depth(of_depth * self.total)
        x = np.empty((3, n))
        x[0] = d
        for k, chance in enumerate((of_left, of_up)):
            low, high = self._limits(d)[k]
            seen = self.z[k] + self.sensor.sigma * truncated(chance, low, high)
            x[k + 1] = np.clip(d * seen, self.box.low[k + 1], self.box.high[k + 1])
        return x

    def log_density(self, x: States) -> LogWeights:
        """(n,): log q̄ per m³, −inf outside the box and where it is not ahead."""
        ahead = x[0] >= self.depths[0]
        d = np.where(ahead, x[0], 1.0)
        density = np.interp(d, self.depths, self.by_depth) / (self.total * d**2)
        with np.errstate(divide="ignore"):
            log_q: LogWeights = np.log(density)
        for k, limits in enumerate(self._limits(d)):
            e = (x[k + 1] / d - self.z[k]) / self.sensor.sigma
            shown = np.maximum(probability(*limits), LEAST)
            log_q -= 0.5 * e**2 + np.log(shown * self.sensor.sigma * math.sqrt(2.0 * math.pi))
        return np.where(ahead & (self.box.log_prior(x) == 0.0), log_q, -np.inf)

    def _limits(self, d: Reals) -> list[tuple[Reals, Reals]]:
        """What the box shows at each depth, left and up, in deviations from z."""
        return [
            ((low - self.z[k]) / self.sensor.sigma, (high - self.z[k]) / self.sensor.sigma)
            for k, (low, high, _) in enumerate(sections(self.sensor, self.box, d))
        ]

    def _depth(self, area: Reals) -> Reals:
        """Where the integral of the straight lines reaches an area."""
        at = np.searchsorted(self.cumulative, area, side="right") - 1
        at = np.clip(at, 0, len(self.depths) - 2)
        a, b = self.by_depth[at], self.by_depth[at + 1]
        piece = np.maximum(self.cumulative[at + 1] - self.cumulative[at], LEAST)
        r = np.clip((area - self.cumulative[at]) / piece, 0.0, 1.0)
        # r (a + b) / 2 = a t + (b − a) t² / 2, solved such that a = b and a = 0 are no exceptions.
        t = r * (a + b) / np.maximum(a + np.sqrt(a**2 + r * (b**2 - a**2)), LEAST)
        return self.depths[at] + t * (self.depths[at + 1] - self.depths[at])


def depths_of(box: Box) -> Reals:
    """(K,): knots over the depths that a box has ahead of the camera."""
    return np.linspace(max(box.low[0], NEAREST), box.high[0], KNOTS)


def sections(sensor: ImageBearing, box: Box, d: Reals) -> list[tuple[Reals, Reals, float]]:
    """Left and up, in tangents: where the box begins and ends at each depth, and half the image."""
    return [(box.low[k + 1] / d, box.high[k + 1] / d, sensor.half[k]) for k in range(2)]


def probability(low: Reals, high: Reals) -> Reals:
    """Φ(high) − Φ(low), from the tail that they are in."""
    right = low > 0.0
    p: Reals = ndtr(np.where(right, -low, high)) - ndtr(np.where(right, -high, low))
    return p


def truncated(chance: Reals, low: Reals, high: Reals) -> Reals:
    """A standard normal between low and high by inversion, from the tail that they are in."""
    right = low > 0.0
    sign = np.where(right, -1.0, 1.0)
    start, end = ndtr(np.where(right, -high, low)), ndtr(np.where(right, -low, high))
    with np.errstate(divide="ignore"):
        e: Reals = sign * ndtri(start + chance * (end - start))
    return np.clip(e, low, high)


def within(h: Reals, half: float, sigma: float) -> Reals:
    """∫ P(h) dh, P the probability that N(h, σ²) is within ± half; ∫ Φ(t) dt = t Φ(t) + φ(t)."""

    def integral(t: Reals) -> Reals:
        value: Reals = t * ndtr(t) + np.exp(-0.5 * t**2) / math.sqrt(2.0 * math.pi)
        return value

    return sigma * (integral((h + half) / sigma) - integral((h - half) / sigma))
