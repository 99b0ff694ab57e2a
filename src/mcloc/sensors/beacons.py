"""p(r | x), the range to a radio beacon at the distance d from the antenna of a robot at x:

    p(r | d) = w t_ν((r − d) / s) / s + p_late [r ≥ d] exp(−(r − d) / λ) / λ + p_outlier / r_max

for 0 < r ≤ r_max, w = 1 − p_late − p_outlier, s² = σ² + σ_bias²; what is left to 1 is the chance
that there is no range. Radio waves that come by a detour are late, never early.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from mcloc.errors import ConfigError
from mcloc.events import BeaconRanges
from mcloc.maps.beacons import Beacons
from mcloc.registry import Configurable, param
from mcloc.statespace import LogWeights, States

NOTHING = 1e-9  # readings that one without a range is worth: it must be > 0
NEAR = 3.0  # s from the distance up to which a range is explained

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BeaconModel(Configurable):
    """Ranges to radio beacons, without a bearing, for poses (3, n), map frame.

    A range has an error of its own, σ, and a bias that nobody knows, of the radio, the antenna and
    the surveyed place: their sum has deviations s and the tails of Student's t. A share of the
    ranges is late, and a share is anything. That there is no range says nothing about the place: a
    robot is told of it for too many reasons.

    From one place a beacon errs again as it did, so ranges are tempered by their novelty. And a
    beacon that errs more often than this lets expect is trusted less: where it failed F times
    (farther than 3 s off), of which E were to be expected, its readings count

        (1 + E) / (1 + F + P)

    at most 1. P is 1 beside other sensors: a beacon of which nothing is known is believed half, or
    a bad one could outvote them at the start. Where a robot has only beacons P is 0. The runtime
    counts, for each beacon by itself. E is by this model, or by how often a typical sensor of the
    robot fails, if that is more: the median of its other sensors, or where it has none, of its
    beacons. Where most of these fail, it is not they that are wrong.

    All beacons share one evidence: a single one that fails is no sign that the robot is lost.

    Raises ConfigError for a reading of a beacon that is not in the map, and for shares of late and
    of false ranges that leave nothing.
    """

    beacons: Beacons
    sigma: float = param(0.1, "m", "deviation of a range", above=0, high=100)
    sigma_bias: float = param(0.2, "m", "deviation of the unknown bias", low=0, high=100)
    nu: float = param(4.0, "", "degrees of freedom of Student's t", low=1, high=1e3)
    p_late: float = param(0.05, "", "share of ranges by a detour", low=0, high=0.9)
    late: float = param(1.0, "m", "mean detour", above=0, high=1e4)
    p_outlier: float = param(0.02, "", "share of ranges that are anything", above=0, high=0.9)
    range_max: float = param(50.0, "m", "longest range that is measured", above=0, high=1e5)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.p_late + self.p_outlier >= 1.0:
            raise self.wrong(
                f"p_late + p_outlier must be below 1, got {self.p_late + self.p_outlier:g}"
            )

    @property
    def scale(self) -> float:
        """s, metres."""
        return math.hypot(self.sigma, self.sigma_bias)

    @property
    def p_failure(self) -> float:
        """How likely it is that a range is farther than 3 s off."""
        beyond = 2.0 * float(stdtr(self.nu, -NEAR))
        detour = self.p_late * math.exp(-NEAR * self.scale / self.late)
        return (1.0 - self.p_late - self.p_outlier) * beyond + detour + self.p_outlier

    def density(self, r: Array | float, d: Array) -> Array:
        """p(r | d) per metre for 0 < r ≤ range_max, broadcast."""
        e, nu = np.asarray(r - d), self.nu
        tails = (1.0 + (e / self.scale) ** 2 / nu) ** (-0.5 * (nu + 1.0))
        near = (1.0 - self.p_late - self.p_outlier) * self._peak * tails
        detour = np.where(e >= 0.0, np.exp(-np.maximum(e, 0.0) / self.late) / self.late, 0.0)
        density: Array = near + self.p_late * detour + self.p_outlier / self.range_max
        return density

    def no_range(self, d: Array) -> Array:
        """The chance that there is none, for each distance d: the rest of `density`."""
        s, far = self.scale, self.range_max
        near = stdtr(self.nu, -d / s) + stdtr(self.nu, (d - far) / s)
        detour = np.exp(-np.maximum(far - d, 0.0) / self.late)
        chance: Array = (1.0 - self.p_late - self.p_outlier) * near + self.p_late * detour
        return chance

    def trust(self, z: BeaconRanges) -> Array:
        """(k,): how much a range of each of these beacons counts."""
        expected = max(self.p_failure, z.usual) * z.heard
        unknown = 0.0 if z.alone else 1.0
        trust: Array = np.minimum(1.0, (1.0 + expected) / (1.0 + z.failed + unknown))
        return trust

    def log_likelihood(self, x: States, z: BeaconRanges) -> LogWeights:
        """(n,): log p(z | x), relative to the p of ranges that are just the distances, so that the
        ranges of any beacons compare: 0 where they are.
        """
        log_p = np.zeros(x.shape[1])
        best = math.log(float(self.density(0.0, np.zeros(1))[0]))
        for beacon, r, worth in self.measured(z):
            d = self.distance(x, beacon, z.antenna)
            log_p += worth * (np.log(self.density(r, d)) - best)
        return log_p

    def readings(self, z: BeaconRanges) -> float:
        """How many ranges it is worth; next to nothing where there are none."""
        return max(sum(worth for _, _, worth in self.measured(z)), NOTHING)

    def beams(self, z: BeaconRanges) -> int:
        """How many ranges were measured."""
        return int(np.sum(self._usable(z)))

    def source(self, z: BeaconRanges) -> str:
        """The radio, whichever beacon answers."""
        return "beacons"

    def explained(self, x: States, z: BeaconRanges) -> Array:
        """(n,): the share of the ranges within 3 s of the distance; NaN without any."""
        near = np.zeros(x.shape[1])
        for beacon, r, _ in self.measured(z):
            near += np.abs(r - self.distance(x, beacon, z.antenna)) <= NEAR * self.scale
        measured = self.beams(z)
        return near / measured if measured else np.full(x.shape[1], np.nan)

    def measured(self, z: BeaconRanges) -> list[tuple[int, float, float]]:
        """Beacon and range of each reading that has one, and how many independent readings it is
        worth of a beacon that does as modelled.
        """
        known = z.beacon < len(self.beacons.names)
        if not known.all():
            raise ConfigError(
                f"a range to beacon {z.beacon[~known][0]}, but there are "
                f"{len(self.beacons.names)}, from 0 on"
            )
        worth = z.novelty * self.trust(z)
        table = zip(z.beacon.tolist(), z.range.tolist(), worth.tolist(), strict=True)
        return [reading for reading, usable in zip(table, self._usable(z), strict=True) if usable]

    def distance(self, x: States, beacon: int, antenna: Array) -> Array:
        """(n,): d in space, metres, from the antenna of a robot at each x."""
        cos, sin = np.cos(x[2]), np.sin(x[2])
        ahead, left, up = antenna.tolist()
        there = self.beacons.places[beacon]
        dx = there[0] - (x[0] + cos * ahead - sin * left)
        dy = there[1] - (x[1] + sin * ahead + cos * left)
        d: Array = np.sqrt(dx**2 + dy**2 + (there[2] - up) ** 2)
        return d

    @property
    def _peak(self) -> float:
        """t_ν(0) / s, per metre."""
        nu = self.nu
        log = math.lgamma(0.5 * (nu + 1.0)) - math.lgamma(0.5 * nu) - 0.5 * math.log(nu * math.pi)
        return math.exp(log) / self.scale

    def _usable(self, z: BeaconRanges) -> NDArray[np.bool_]:
        return z.returned & (z.range <= self.range_max)
