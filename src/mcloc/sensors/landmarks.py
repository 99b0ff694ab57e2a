"""p(z | x) = Π_k p(r_k | x) p(b_k | x), ranges and bearings to landmarks of known identity:

    p(r | x) = (1 − ε) N(r; d, σ_d²) + ε / r_max,  σ_d² = σ_range² + (σ_relative d)²,
    p(b | x) = (1 − ε) Σ_j N(b + 2 π j; β, σ_bearing²) + ε / 2 π,

d and β the distance and the bearing of the landmark from x  [PR §6.6, Table 6.4; the landmarks of
Gutmann, Fox: IROS 2002, and Estivill-Castro, McKenzie: Hierarchical Monte-Carlo localisation].
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.events import Sightings
from mcloc.geometry import wrap
from mcloc.maps.landmarks import Landmarks
from mcloc.motion.left_invariant import log_wrapped_normal
from mcloc.registry import Configurable, param
from mcloc.statespace import LogWeights, States

NOTHING = 1e-9  # readings that an empty sighting is worth: it must be > 0

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LandmarkModel(Configurable):
    """Range and bearing to landmarks of known identity, for poses (3, n), map frame; for places
    (2, n) ranges alone.

    What the sensor reports is taken as it comes: neither that a landmark was not seen nor that a
    quantity was not measured says anything. A range that is not in (0, range_max] is none, and
    neither is one that is NaN. Raises ConfigError for a landmark that is not in the map, and for a
    bearing where states have no heading.
    """

    landmarks: Landmarks
    sigma_range: float = param(0.05, "m", "deviation of a range to 0 m", above=0, high=100)
    sigma_relative: float = param(
        0.1, "m/m", "deviation per distance, in quadrature", low=0, high=10
    )
    sigma_bearing: float = param(0.05, "rad", "deviation of a bearing", above=0, high=2)
    range_max: float = param(8.0, "m", "longest range that is measured", above=0, high=1e5)
    p_outlier: float = param(
        0.01, "", "ε: chance that a range or a bearing is anything", above=0, high=1
    )

    @property
    def places(self) -> Array:
        """(L, 2): of the landmarks, metres, map frame."""
        return self.landmarks.places

    def sigma(self, d: Array) -> Array:
        """σ_d, metres, at a distance d."""
        return np.hypot(self.sigma_range, self.sigma_relative * d)

    def range_density(self, r: Array | float, d: Array) -> Array:
        """p(r | d) per metre for 0 < r ≤ range_max, broadcast. What its integral over these lacks
        to 1 is the chance that the range is none of them, and not measured.
        """
        sigma = self.sigma(d)
        normal = np.exp(-0.5 * ((r - d) / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi))
        density: Array = (1.0 - self.p_outlier) * normal + self.p_outlier / self.range_max
        return density

    def bearing_density(self, off: Array) -> Array:
        """(n,): p(b | β) per radian by off = b − β; its integral over the circle is 1."""
        normal = np.exp(log_wrapped_normal(off, self.sigma_bearing))
        density: Array = (1.0 - self.p_outlier) * normal + self.p_outlier / (2.0 * math.pi)
        return density

    def log_likelihood(self, x: States, z: Sightings) -> LogWeights:
        """(n,): log p(z | x), relative to the p of ranges and bearings that are just those
        expected, so that sightings of any landmarks compare: 0 where they are. Nearer landmarks
        have smaller deviations, so it may be more than 0, by at most σ_relative² / 2 a range.
        """
        log_p = np.zeros(x.shape[1])
        for one in self._each(x, z):
            log_p += self._log_p(x, *one)
        return log_p

    def readings(self, z: Sightings) -> float:
        """How many quantities were measured; next to nothing where there are none."""
        return max(float(self.beams(z)), NOTHING)

    def beams(self, z: Sightings) -> int:
        """How many quantities were measured."""
        return int(np.sum(self._in_reach(z.range)) + np.sum(np.isfinite(z.bearing)))

    def source(self, z: Sightings) -> str:
        """The sensor's name."""
        return z.source

    def explained(self, x: States, z: Sightings) -> Array:
        """(n,): the share of the quantities within 3 deviations of what is expected; NaN where
        nothing was measured.
        """
        near = np.zeros(x.shape[1])
        for landmark, r, b in self._each(x, z):
            d, direction = self._towards(x, landmark)
            if self._in_reach(r):
                near += np.abs(r - d) <= 3.0 * self.sigma(d)
            if np.isfinite(b):
                near += np.abs(wrap(b - (direction - x[2]))) <= 3.0 * self.sigma_bearing
        measured = self.beams(z)
        return near / measured if measured else np.full(x.shape[1], np.nan)

    def _log_p(self, x: States, landmark: int, r: float, b: float) -> LogWeights:
        """(n,): log p of one sighting if it is of this landmark, relative to an expected one."""
        d, direction = self._towards(x, landmark)
        log_p = np.zeros(x.shape[1])
        if self._in_reach(r):
            log_p += np.log(self.range_density(r, d) / self.range_density(r, np.array(r)))
        if np.isfinite(b):
            p = self.bearing_density(b - (direction - x[2]))
            log_p += np.log(p / self.bearing_density(np.zeros(1)))
        return log_p

    def _each(self, x: States, z: Sightings) -> Iterator[tuple[int, float, float]]:
        """Landmark, range and bearing of each sighting, all known to be usable with x."""
        wrong = z.landmark[(z.landmark < 0) | (z.landmark >= len(self.places))]
        if wrong.size:
            raise ConfigError(
                f"LandmarkModel: a sighting of landmark {wrong[0]}, but there are "
                f"{len(self.places)}, from 0 on"
            )
        if len(x) == 2 and np.isfinite(z.bearing).any():
            raise ConfigError(
                "LandmarkModel: a bearing says nothing about states without a heading; set "
                "bearings to NaN, or use states x, y, θ"
            )
        return zip(z.landmark.tolist(), z.range.tolist(), z.bearing.tolist(), strict=True)

    def _towards(self, x: States, landmark: int) -> tuple[Array, Array]:
        """(n,): distance (m) and direction (rad, map frame) from each x to a landmark."""
        dx, dy = self.places[landmark][:, None] - x[:2]
        return np.hypot(dx, dy), np.arctan2(dy, dx)

    def _in_reach(self, r: Array | float) -> NDArray[np.bool_]:
        """Which ranges are measured ones."""
        return (r > 0.0) & (np.asarray(r) <= self.range_max)
