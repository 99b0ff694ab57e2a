"""q̄(x) = p(z | x) / π(z) of sightings: in the plane a place at distance d from a landmark has
density ∝ d p(r | d), so that

    q̄(x) = ε U(x) + (1 − ε) Σ_k β_k p(r_k | d) p(b_k | x) / Z_k,  Z_k = 2 π ∫ d p(r_k | d) dd,

d the distance of the sensor from the landmark of sighting k  [Fox01 Eq. 19.3.7; the circles of PR
§6.6.4, Table 6.5].
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from mcloc.draws import Draws, Stream
from mcloc.events import UNKNOWN, Sightings
from mcloc.geometry import compose, wrap
from mcloc.protocols import Environment, PoseDensity
from mcloc.samplers.found_poses import chosen_from, log_pi_of, robot_at
from mcloc.sensors.landmarks import LandmarkModel
from mcloc.statespace import LogWeights, States

COARSE, FINE = 256, 768  # knots over all distances, and around the measured one
PEAK = 6.0  # deviations around a measured range that have the fine ones
BEYOND = 3.0  # deviations beyond range_max from where a landmark is not seen any more
LEAST = 1e-300
LOOKS = 2000  # poses that π is estimated from
_EDGE = 1e-9  # m that the density goes beyond the samples: a pose is rounded

Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LandmarkCircles:
    """Poses of a robot from the landmarks that it saw at one time.

    Each sighting alone leaves a circle around its landmark, on which the robot faces so that it has
    the bearing; q̄ is a mixture of the circles of all sightings, with equal shares β. Several meet
    where the robot is: the filter's weights are exact, and say so. A sighting without a range
    leaves the disc from which a landmark is seen, one without a bearing all headings, and one
    whose landmark is not known the circles of all. A share `floor` of q̄ is U, since all that was
    seen may be false: it bounds importance weights wherever a robot can be.
    """

    sensor: LandmarkModel
    environment: Environment
    floor: float = 0.1

    def given(self, z: Sightings, draws: Draws) -> PoseDensity:
        """q̄ for one measurement."""
        return CircleDensity(self.sensor, self.environment, self.floor, z, draws)


@dataclass(frozen=True, eq=False)
class Ring:
    """Distances of a sensor from a landmark: d p(r | d), a straight line between knots; d itself
    where no range was measured.

    Drawn by inversion of this table: what is drawn is exactly what `density` says.
    """

    knots: Reals
    values: Reals

    @classmethod
    def of(cls, sensor: LandmarkModel, r: float) -> "Ring":
        """By a model and a measured range, NaN for none."""
        top = sensor.range_max + BEYOND * float(sensor.sigma(np.array(sensor.range_max)))
        knots = np.linspace(0.0, top, COARSE)
        if math.isnan(r):
            return cls(knots, knots)
        reach = PEAK * float(sensor.sigma(np.array(r)))
        near = np.linspace(max(r - reach, 0.0), min(r + reach, top), FINE)
        knots = np.unique(np.concatenate([knots, near]))
        return cls(knots, knots * sensor.range_density(r, knots))

    @cached_property
    def cumulative(self) -> Reals:
        """(K,): the integral up to each knot."""
        pieces = 0.5 * (self.values[1:] + self.values[:-1]) * np.diff(self.knots)
        return np.concatenate([[0.0], np.cumsum(pieces)])

    def density(self, d: Reals) -> Reals:
        """(n,): per m² of the plane, at a distance."""
        inside = d <= self.knots[-1] + _EDGE
        d = np.maximum(d, self.knots[1] * 1e-6)  # both are 0 there, in this ratio
        around = 2.0 * math.pi * d * self.cumulative[-1]
        return np.where(inside, np.interp(d, self.knots, self.values) / around, 0.0)

    def distance(self, u: Reals) -> Reals:
        """(n,): where the integral of the straight lines reaches a share u of it."""
        area = u * self.cumulative[-1]
        at = np.searchsorted(self.cumulative, area, side="right") - 1
        at = np.clip(at, 0, len(self.knots) - 2)
        a, b = self.values[at], self.values[at + 1]
        piece = self.cumulative[at + 1] - self.cumulative[at]
        share = np.clip((area - self.cumulative[at]) / piece, 0.0, 1.0)
        # share (a + b) / 2 = a t + (b − a) t² / 2, solved so that a = b is no exception.
        t = share * (a + b) / np.maximum(a + np.sqrt(a**2 + share * (b**2 - a**2)), LEAST)
        d: Reals = self.knots[at] + t * (self.knots[at + 1] - self.knots[at])
        return d


@dataclass(frozen=True, eq=False)
class CircleDensity:
    """q̄ for one measurement z; ε = floor, 1 where nothing was measured. draws: for the estimate of
    π; those of samples must be others.
    """

    sensor: LandmarkModel
    environment: Environment
    floor: float
    z: Sightings
    draws: Draws

    def __post_init__(self) -> None:
        self._circles, self._chosen_from  # noqa: B018 - ready before threads ask for them

    def sample(self, draws: Draws, first: int, n: int) -> States:
        """(3, n): poses of the particles first … first + n − 1, map frame."""
        u = draws.uniform(Stream.TREE, first, n)
        x = self.environment.sample(draws, first, n)
        chosen = np.searchsorted(self._chosen_from, u[0], side="right") - 1
        for k, (_, landmark, bearing, ring) in enumerate(self._circles):
            here = np.flatnonzero(chosen == k)
            d, direction = ring.distance(u[1, here]), 2.0 * math.pi * u[2, here]
            away = np.stack([np.cos(direction), np.sin(direction)])
            seen_at = self.sensor.places[landmark][:, None] - d * away
            heading = direction - self._bearings(bearing, u[3, here])
            sensor = np.stack([*seen_at, wrap(heading)])
            x[:, here] = robot_at(sensor, self.z.mount)
        return x

    def log_density(self, x: States) -> LogWeights:
        """(n,): log q̄ at each column of x (3, n) per m² rad; −inf only where neither a circle nor U
        has any.
        """
        sensor = compose(x.T, self.z.mount).T
        floor = self.floor if self._circles else 1.0
        density = floor * np.exp(self.environment.log_density(x))
        for share, landmark, bearing, ring in self._circles:
            dx, dy = self.sensor.places[landmark][:, None] - sensor[:2]
            part = (1.0 - floor) * share * ring.density(np.hypot(dx, dy))
            if math.isnan(bearing):
                part /= 2.0 * math.pi
            else:
                part *= self.sensor.bearing_density(bearing - (np.arctan2(dy, dx) - sensor[2]))
            density += part
        with np.errstate(divide="ignore"):
            log: LogWeights = np.log(density)
        return log

    @cached_property
    def log_pi(self) -> float:
        """log π, π = ∫ p(z | x) p(x | m) dx over the poses that q̄ has, as an importance sample of q̄
        gives it; worked out when it is first asked for.
        """
        return log_pi_of(self, self._fit, self.draws, LOOKS)

    def _fit(self, x: States) -> LogWeights:
        log_p: LogWeights = self.sensor.log_likelihood(x, self.z) + self.environment.log_prior(x)
        return log_p

    def _bearings(self, measured: float, u: Reals) -> Reals:
        """(n,): where the landmark lies from a sensor's heading, by inversion of u: an outlier
        below p_outlier, and else as measured.
        """
        if math.isnan(measured):
            return 2.0 * math.pi * u
        outlier = self.sensor.p_outlier
        right = u > outlier
        normal = np.full(len(u), 0.0)
        normal[right] = ndtri((u[right] - outlier) / (1.0 - outlier))
        off: Reals = np.where(
            right, self.sensor.sigma_bearing * normal, 2.0 * math.pi * u / outlier
        )
        return measured + off

    @cached_property
    def _circles(self) -> list[tuple[float, int, float, Ring]]:
        """Share, landmark, bearing (NaN for none) and distances of each part of the mixture."""
        found = []
        sightings = list(self.sensor.measured(self.z))
        for landmark, r, b in sightings:
            ring = Ring.of(self.sensor, r)
            known = (landmark,) if landmark != UNKNOWN else range(len(self.sensor.places))
            found += [(1.0 / (len(sightings) * len(known)), one, b, ring) for one in known]
        return found

    @cached_property
    def _chosen_from(self) -> Reals:
        """(circles,): as `chosen_from`."""
        return chosen_from(self.floor, np.array([share for share, *_ in self._circles]))
