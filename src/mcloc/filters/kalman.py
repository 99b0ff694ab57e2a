"""x̂ = x̄ + Λ⁻¹ J (z − x̄), Λ = Σ̄⁻¹ + J: an extended Kalman filter that measures the pose at which
a scan matches the map, with information J  [Fox99, Kalman filter-based techniques; Gutmann,
Schlegel: AMOS, EUROBOT 1996; Probabilistic Robotics, Tables 3.3 and 3.4]; sightings of landmarks
it measures as they are (landmark_ekf.py).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from mcloc.density import Gaussian
from mcloc.draws import Draws
from mcloc.errors import ConfigError
from mcloc.estimate import Hypothesis, away
from mcloc.events import BeaconRanges, Message, Sightings
from mcloc.events.measured import is_own
from mcloc.filters.filter import StepInfo
from mcloc.filters.landmark_ekf import LandmarkEKF
from mcloc.filters.models import Models
from mcloc.filters.pose_match import match
from mcloc.filters.recovery import LITTLE, Evidence, Recovery
from mcloc.geometry import Pose, compose, transported, wrap
from mcloc.motion.moments import moments_of_move
from mcloc.particles import Particles, log_sums_exp
from mcloc.protocols import Density, Environment, MotionModel, SensorModel
from mcloc.registry import Configurable, param
from mcloc.sensors.fused import Fused
from mcloc.sensors.landmarks import LandmarkModel
from mcloc.statespace import SE2, LogWeights, States
from mcloc.storage import Arrays

POINTS = 512  # that stand for a Gaussian; even
LEAST_GATE = np.array([0.3, 0.3, np.deg2rad(6.0)])
"""m, m, rad: three steps of the lattice, however sure the filter is."""


@dataclass(frozen=True, eq=False)
class GaussianBelief:
    """N(x; mean, covariance). mean: (3,) m, m, rad. covariance: (3, 3), positive definite."""

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    evidence: Mapping[str, Evidence] = field(default_factory=dict)

    @cached_property
    def particles(self) -> Particles:
        """Points of equal weight with this very mean and covariance."""
        return Particles.equal(_points(self.mean, self.covariance))


@dataclass(frozen=True)
class KalmanFilter:
    """The belief is one Gaussian. gate: deviations to each side within which scans are matched.
    sightings: corrects by those of landmarks; None where there are none.

    Where the scan fits the prediction worse than usual, the move is doubted as in a particle
    filter: the Gaussian is that with the moments of both motion models.
    """

    motion: MotionModel
    sensor: SensorModel
    environment: Environment
    recovery: Recovery
    gate: float = 3.0
    sightings: LandmarkEKF | None = None

    def start(self, initial: Density, draws: Draws) -> GaussianBelief:
        """The Gaussian that is given. Raises ConfigError for any other density."""
        if not isinstance(initial, Gaussian):
            raise ConfigError(
                "a Kalman filter follows one Gaussian and cannot search for the robot: say where "
                "it starts (--initial, of a team --told-start), or take another filter (--filter "
                "mixture)"
            )
        return GaussianBelief(initial.mean, initial.covariance)

    def step(
        self, bel: GaussianBelief, u: Any, z: Any, draws: Draws
    ) -> tuple[GaussianBelief, StepInfo]:
        """The belief after moving by u and matching z."""
        source = self.sensor.source(z)
        evidence = bel.evidence.get(source, Evidence())
        expected = self._predicted(bel, self.motion, u, draws)
        log_evidence, likelihood = self._evidence(expected, z)
        # One range that is off is an outlier, and what others tell says nothing of the wheels.
        doubted = not isinstance(z, (BeaconRanges, Message))
        doubt = self.recovery.doubt(evidence, likelihood) if doubted else 0.0
        if doubt > 0.0:
            loose = self._predicted(bel, self.motion.doubted(), u, draws)
            expected = _mixed(expected, loose, doubt)
            log_evidence, likelihood = self._evidence(expected, z)
        corrected, weighed = self._corrected(expected, z)
        after = GaussianBelief(corrected.mean, corrected.covariance)
        sure = away(after.particles, SE2) <= LITTLE
        readings = self.sensor.readings(z)
        evidence = evidence.updated(likelihood, readings, self.recovery.rates, sure)
        info = StepInfo(
            n=POINTS,
            ess=float(POINTS),
            log_evidence=log_evidence,
            evidence=evidence,
            weighed=weighed + (2 if doubt > 0.0 else 1) * POINTS,
            doubt=doubt,
        )
        if not is_own(z):
            return replace(after, evidence=bel.evidence), info
        return replace(after, evidence={**bel.evidence, source: evidence}), info

    def hypotheses(self, bel: GaussianBelief) -> tuple[Hypothesis, ...]:
        """The only one."""
        return (Hypothesis(bel.mean, bel.covariance, 1.0),)

    def adopted(self, bel: GaussianBelief) -> GaussianBelief:
        """The same Gaussian: it knows no map."""
        return replace(bel, evidence={})

    def packed(self, bel: GaussianBelief) -> tuple[dict[str, Any], Arrays]:
        """Mean and covariance."""
        return {}, {"mean": bel.mean, "covariance": bel.covariance}

    def unpacked(
        self, values: dict[str, Any], arrays: Arrays, evidence: dict[str, Evidence]
    ) -> GaussianBelief:
        """The belief that `packed` describes."""
        return GaussianBelief(arrays["mean"], arrays["covariance"], evidence)

    def _predicted(
        self, bel: GaussianBelief, motion: MotionModel, u: Any, draws: Draws
    ) -> Gaussian:
        """Moved by u: Σ̄ = G Σ Gᵀ + V M Vᵀ."""
        move, noise = moments_of_move(motion, u, draws)
        cos, sin = np.cos(bel.mean[2]), np.sin(bel.mean[2])
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        covariance = transported(bel.mean, bel.covariance, move) + turn @ noise @ turn.T
        return Gaussian(compose(bel.mean, move), covariance)

    def _corrected(self, expected: Gaussian, z: Any) -> tuple[Gaussian, int]:
        """By what z measures, and at how many poses it was looked."""
        if self.sightings is not None and isinstance(z, Sightings):
            return self.sightings(expected, z)
        found = match(lambda x: self._log_p(x, z), expected, self._gate(expected))
        return _corrected(expected, found.pose, found.information), found.weighed

    def _gate(self, expected: Gaussian) -> NDArray[np.float64]:
        """(3,): how far from the expected mean a scan is matched, m, m, rad."""
        reach: NDArray[np.float64] = np.maximum(
            self.gate * np.sqrt(np.diag(expected.covariance)), LEAST_GATE
        )
        reach[2] = min(reach[2], np.pi)
        return reach

    def _log_p(self, x: States, z: Any) -> LogWeights:
        """(n,): log p(z | x) p(x | m)."""
        log_p: LogWeights = self.sensor.log_likelihood(x, z) + self.environment.log_prior(x)
        return log_p

    def _evidence(self, expected: Gaussian, z: Any) -> tuple[float, float]:
        """log p(z | d_{0…t−1}), and the mean of p(z | x)^(1/readings): both over the Gaussian that
        was expected.
        """
        x = _points(expected.mean, expected.covariance)
        prior, log_p = self.environment.log_prior(x), self.sensor.log_likelihood(x, z)
        before, after, of_one = log_sums_exp(prior, log_p, 0.0, 1.0, 1.0 / self.sensor.readings(z))
        likelihood = float(np.exp(of_one - before)) if np.isfinite(before) else 0.0
        return after - float(np.log(POINTS)), likelihood


def _mixed(a: Gaussian, b: Gaussian, share: float) -> Gaussian:
    """With the moments of (1 − share) a + share b."""
    apart = b.mean - a.mean
    apart[2] = wrap(apart[2])
    mean = a.mean + share * apart
    mean[2] = wrap(mean[2])
    within = (1.0 - share) * a.covariance + share * b.covariance
    return Gaussian(mean, within + share * (1.0 - share) * np.outer(apart, apart))


def _corrected(expected: Gaussian, pose: Pose, information: NDArray[np.float64]) -> Gaussian:
    """After a pose was measured with such information, which may be singular, Λ⁻¹ = (I + Σ̄ J)⁻¹
    Σ̄.
    """
    prior = expected.covariance
    covariance = np.linalg.solve(np.eye(3) + prior @ information, prior)
    covariance = 0.5 * (covariance + covariance.T)
    innovation = pose - expected.mean
    innovation[2] = wrap(innovation[2])
    mean = expected.mean + covariance @ information @ innovation
    mean[2] = wrap(mean[2])
    return Gaussian(mean, covariance)


def _points(mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> States:
    """(3, POINTS): points with this mean and covariance, that are spread as a Gaussian."""
    x: States = mean[:, None] + np.linalg.cholesky(covariance) @ _NORMAL
    x[2] = wrap(x[2])
    return x


def _normal() -> NDArray[np.float64]:
    """(3, POINTS): the same for mean 0 and covariance 1, each point with its opposite. The uniform
    ones that they are made of fill the cube evenly [Roberts 2018, the sequence R₃].
    """
    ratio = 1.2207440846057596  # x⁴ = x + 1
    steps = ratio ** -np.arange(1.0, 4.0)
    uniform = np.mod(0.5 + steps[:, None] * np.arange(1, POINTS // 2 + 1), 1.0)
    half = ndtri(uniform)
    both = np.concatenate([half, -half], axis=1)
    root = np.linalg.cholesky(both @ both.T / POINTS)
    even: NDArray[np.float64] = np.linalg.solve(root, both)
    return even


_NORMAL = _normal()


@dataclass(frozen=True)
class Kalman(Configurable):
    """An extended Kalman filter: one Gaussian, and as measurement the pose at which a scan matches
    the map, or ranges and bearings to known landmarks. A baseline: it needs a start pose, and once
    it is wrong it stays wrong.

    Of recovery it takes the doubt in the wheels and how fast the averages follow; it has no use for
    random particles, nor for size, resampler, people and sampler.
    """

    gate: float = param(
        3.0,
        "",
        "deviations around what is expected within which scans are matched, landmarks believed",
        above=0,
        high=10,
    )

    def compose(self, models: Models) -> KalmanFilter:
        chosen = models.motion, models.sensor, models.environment
        known = models.sensor.models if isinstance(models.sensor, Fused) else {}
        landmarks = known.get(Sightings)
        ekf = LandmarkEKF(landmarks, self.gate) if isinstance(landmarks, LandmarkModel) else None
        return KalmanFilter(*chosen, models.recovery, self.gate, ekf)
