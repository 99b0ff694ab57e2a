"""p(z | x) = Π_k p(r_k, b_k | x), ranges and bearings to landmarks:

    p(r | d) = (1 − ε) N(r; d, σ_d²) + ε / r_max,  σ_d² = σ_range² + (σ_relative d)²,
    p(b | β) = (1 − ε) Σ_j N(b + 2 π j; β, σ_bearing²) + ε / 2 π,
    p(r, b | x) = (1 − p_false) p(r | d) p(b | β) + p_false / (2 π r_max),

d and β the distance and the bearing of the landmark from the sensor  [PR §6.6, Table 6.4; the
landmarks of Gutmann, Fox: IROS 2002, and Estivill-Castro, McKenzie: Hierarchical Monte-Carlo
localisation]. Which landmark it is, nobody may know: then p(r | d) p(b | β) is its mean over those
that are in view  [PR Table 6.4 with c_k summed out]. In view is landmark j with the chance that
what is measured of it lies within the sensor's limits,

    v_j = P(N(d_j, σ_d²) ≤ r_max) Σ_i P(|N(β_j + 2 π i, σ_bearing²)| ≤ fov / 2).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from mcloc.errors import ConfigError
from mcloc.events import UNKNOWN, Sightings
from mcloc.geometry import Pose, compose, wrap
from mcloc.maps.landmarks import Landmarks
from mcloc.motion.left_invariant import log_wrapped_normal
from mcloc.registry import Configurable, param
from mcloc.statespace import LogWeights, States

NOTHING = 1e-9  # readings that an empty sighting is worth: it must be > 0

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LandmarkModel(Configurable):
    """Range and bearing to landmarks, known by name or not, for poses (3, n), map frame; for places
    (2, n) ranges alone.

    That a quantity was not measured says nothing. A range that is not in (0, range_max] is none,
    and neither is one that is NaN. That a landmark was not seen says something where p_detect > 0:
    one in view is seen with chance p_detect, one that is not with ε p_detect, so that

        p(z | x) = Π_seen D_j p(r_j, b_j | x) Π_missed (1 − D_j),  D_j = p_detect (ε + (1 − ε) v_j).

    Where the landmark of any sighting is not known, misses say nothing. Raises ConfigError for a
    landmark that is not in the map; where states have no heading, for a bearing, and for a sensor
    that is not in the robot's middle.

    By default it is a camera, which tells directions to a degree, and ranges by how large things
    look, with errors that repeat themselves.
    """

    landmarks: Landmarks
    sigma_range: float = param(0.05, "m", "deviation of a range to 0 m", above=0, high=100)
    sigma_relative: float = param(
        0.1, "m/m", "deviation per distance, in quadrature", low=0, high=10
    )
    sigma_bearing: float = param(0.02, "rad", "deviation of a bearing", above=0, high=2)
    range_max: float = param(8.0, "m", "longest range that is measured", above=0, high=1e5)
    p_outlier: float = param(
        0.01, "", "ε: chance that a range or a bearing is anything", above=0, high=1
    )
    p_false: float = param(0.0, "", "chance that a sighting is of no landmark", low=0, high=0.99)
    p_detect: float = param(
        0.0, "", "chance that one within `fov` is seen; 0: misses say nothing", low=0, high=0.99
    )
    fov: float = param(
        2.0 * math.pi, "rad", "angle of view, half to each side", above=0, high=2.0 * math.pi
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

    def in_view(self, x: States, landmark: int) -> Array:
        """(n,): v of a landmark from sensors at x, the chance that it is within range and angle of
        view.
        """
        d, direction = self._towards(x, landmark)
        view: Array = ndtr((self.range_max - d) / self.sigma(d))
        if self.fov < 2.0 * math.pi and len(x) == 3:
            view *= self._within_fov(wrap(direction - x[2]))
        return view

    def _within_fov(self, bearing: Array) -> Array:
        """(n,): the chance that a bearing is measured within it; beyond ±π it comes in again."""
        half, sigma = 0.5 * self.fov, self.sigma_bearing
        # Of a bearing as many turns off as these, 6 σ do not reach into view.
        most = math.ceil((half + 6.0 * sigma + math.pi) / (2.0 * math.pi)) - 1
        within = np.zeros(len(bearing))
        for turns in range(-most, most + 1):
            off = bearing + 2.0 * math.pi * turns
            within += ndtr((half - off) / sigma) - ndtr((-half - off) / sigma)
        return within

    def log_likelihood(self, x: States, z: Sightings) -> LogWeights:
        """(n,): log p(z | x), relative to the p of ranges and bearings that are just those
        expected, so that sightings of any landmarks compare: 0 where they are. Nearer landmarks
        have smaller deviations, so it may be more than 0, by at most σ_relative² / 2 a range.
        """
        log_p, at = np.zeros(x.shape[1]), self._sensor(x, z.mount)
        for landmark, r, b in self._each(x, z):
            if landmark == UNKNOWN:
                log_p += self._log_p_of_any(at, r, b)
                continue
            of_it = self._log_p(at, landmark, r, b)
            if self.p_false > 0.0:
                of_it = self._or_false(1.0 - self.p_false, np.exp(of_it), r, b)
            log_p += of_it
        if self.p_detect > 0.0 and (z.landmark != UNKNOWN).all():
            log_p += self._log_p_seen(at, z)
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

    def measured(self, z: Sightings) -> Iterator[tuple[int, float, float]]:
        """Landmark, range and bearing of each sighting that has any; NaN for the one that is none.
        Raises ConfigError for a landmark that is not in the map.
        """
        wrong = z.landmark[(z.landmark < UNKNOWN) | (z.landmark >= len(self.places))]
        if wrong.size:
            raise ConfigError(
                f"LandmarkModel: a sighting of landmark {wrong[0]}, but there are "
                f"{len(self.places)}, from 0 on"
            )
        r = np.where(self._in_reach(z.range), z.range, np.nan)
        b = np.where(np.isfinite(z.bearing), z.bearing, np.nan)
        some = ~(np.isnan(r) & np.isnan(b))
        yield from zip(z.landmark[some].tolist(), r[some].tolist(), b[some].tolist(), strict=True)

    def explained(self, x: States, z: Sightings) -> Array:
        """(n,): the share of the quantities within 3 deviations of what is expected, for a sighting
        without a name of the landmark that explains it best; NaN where nothing was measured.
        """
        near, at = np.zeros(x.shape[1]), self._sensor(x, z.mount)
        for landmark, r, b in self._each(x, z):
            candidates = (landmark,) if landmark != UNKNOWN else range(len(self.places))
            near += np.max([self._near(at, one, r, b) for one in candidates], axis=0)
        measured = self.beams(z)
        return near / measured if measured else np.full(x.shape[1], np.nan)

    def _near(self, x: States, landmark: int, r: float, b: float) -> Array:
        """(n,): how many of two quantities are within 3 deviations."""
        d, direction = self._towards(x, landmark)
        near = np.zeros(x.shape[1])
        if not math.isnan(r):
            near += np.abs(r - d) <= 3.0 * self.sigma(d)
        if not math.isnan(b):
            near += np.abs(wrap(b - (direction - x[2]))) <= 3.0 * self.sigma_bearing
        return near

    def _log_p(self, x: States, landmark: int, r: float, b: float) -> LogWeights:
        """(n,): log p of one sighting if it is of this landmark, relative to an expected one."""
        d, direction = self._towards(x, landmark)
        log_p = np.zeros(x.shape[1])
        if not math.isnan(r):
            log_p += np.log(self.range_density(r, d) / self.range_density(r, np.array(r)))
        if not math.isnan(b):
            p = self.bearing_density(b - (direction - x[2]))
            log_p += np.log(p / self.bearing_density(np.zeros(1)))
        return log_p

    def _log_p_of_any(self, x: States, r: float, b: float) -> LogWeights:
        """(n,): the same of a landmark in view; where there is none, it must be false."""
        view = np.stack([self.in_view(x, k) for k in range(len(self.places))])
        p = np.exp([self._log_p(x, k, r, b) for k in range(len(self.places))])
        seen = view.sum(axis=0)
        mean = (view * p).sum(axis=0) / np.maximum(seen, 1e-300)
        return self._or_false((1.0 - self.p_false) * np.minimum(seen, 1.0), mean, r, b)

    def _or_false(self, share: Array | float, p: Array, r: float, b: float) -> LogWeights:
        """(n,): log of share p + (1 − share) p(r, b | false), relative to an expected sighting."""
        false = 1.0
        if not math.isnan(r):
            false /= self.range_max * float(self.range_density(r, np.array(r)))
        if not math.isnan(b):
            false /= 2.0 * math.pi * float(self.bearing_density(np.zeros(1))[0])
        log_p: LogWeights = np.log(share * p + (1.0 - share) * false)
        return log_p

    def _log_p_seen(self, x: States, z: Sightings) -> LogWeights:
        """(n,): log Π_seen D_j / p_detect Π_missed (1 − D_j)."""
        log_p, seen = np.zeros(x.shape[1]), set(z.landmark.tolist())
        for k in range(len(self.places)):
            shown = self.p_outlier + (1.0 - self.p_outlier) * self.in_view(x, k)
            log_p += np.log(shown) if k in seen else np.log1p(-self.p_detect * shown)
        return log_p

    def _each(self, x: States, z: Sightings) -> Iterator[tuple[int, float, float]]:
        """As `measured`, all known to be usable with x."""
        if len(x) == 2 and np.isfinite(z.bearing).any():
            raise ConfigError(
                "LandmarkModel: a bearing says nothing about states without a heading; set "
                "bearings to NaN, or use states x, y, θ"
            )
        return self.measured(z)

    def _sensor(self, x: States, mount: Pose) -> States:
        """Where the sensors of robots at x are."""
        if not mount.any():
            return x
        if len(x) == 2:
            raise ConfigError(
                "LandmarkModel: nobody knows where a sensor beside the robot's middle is without a "
                "heading; set mount to 0, 0, 0, or use states x, y, θ"
            )
        return np.ascontiguousarray(compose(x.T, mount).T)

    def _towards(self, x: States, landmark: int) -> tuple[Array, Array]:
        """(n,): distance (m) and direction (rad, map frame) from each x to a landmark."""
        dx, dy = self.places[landmark][:, None] - x[:2]
        return np.hypot(dx, dy), np.arctan2(dy, dx)

    def _in_reach(self, r: Array | float) -> NDArray[np.bool_]:
        """Which ranges are measured ones."""
        return (r > 0.0) & (np.asarray(r) <= self.range_max)
