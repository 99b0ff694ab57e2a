"""x̂ = x̄ + K (z − h(x̄)), Σ = (I − K H) Σ̄, K = Σ̄ Hᵀ S⁻¹, S = H Σ̄ Hᵀ + R: an extended Kalman filter
that measures ranges and bearings to landmarks whose names are known  [PR Table 7.2, §7.4].

h(x) = (‖m − s‖, atan2(m_y − s_y, m_x − s_x) − s_θ) of a landmark m and the sensor's pose s = x ⊕
mount.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.density import Gaussian
from mcloc.events import UNKNOWN, Sightings
from mcloc.geometry import Pose, compose, wrap
from mcloc.sensors.landmarks import LandmarkModel

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LandmarkEKF:
    """Corrects a Gaussian by sightings, one after the other, with the deviations of a model.

    A sighting of which any quantity is more than `gate` deviations of S from what is expected is an
    outlier, and left out; so is one whose landmark is not known.
    """

    model: LandmarkModel
    gate: float

    def __call__(self, expected: Gaussian, z: Sightings) -> tuple[Gaussian, int]:
        """The Gaussian after the sightings, and at how many poses these were looked at."""
        for landmark, r, b in self.model.measured(z):
            if landmark != UNKNOWN:
                expected = self._corrected(expected, z.mount, landmark, np.array([r, b]))
        return expected, len(z.landmark)

    def _corrected(self, prior: Gaussian, mount: Pose, landmark: int, measured: Array) -> Gaussian:
        """After one sighting; measured: (2,) range and bearing, NaN for the one that is none."""
        h, jacobian = expected_sighting(prior.mean, mount, self.model.places[landmark])
        known = ~np.isnan(measured)
        off = measured - h
        off[1] = wrap(off[1])
        noise = np.array([float(self.model.sigma(h[0])), self.model.sigma_bearing]) ** 2
        off, jacobian, noise = off[known], jacobian[known], noise[known]
        spread = jacobian @ prior.covariance @ jacobian.T + np.diag(noise)
        if (np.abs(off) > self.gate * np.sqrt(np.diag(spread))).any():
            return prior
        gain = np.linalg.solve(spread, jacobian @ prior.covariance).T
        mean = prior.mean + gain @ off
        mean[2] = wrap(mean[2])
        # Joseph's form stays positive definite.
        left = np.eye(3) - gain @ jacobian
        return Gaussian(mean, left @ prior.covariance @ left.T + (gain * noise) @ gain.T)


def expected_sighting(x: Pose, mount: Pose, place: Array) -> tuple[Array, Array]:
    """h(x), (2,) m and rad, and H = ∂h/∂x, (2, 3), for a landmark at a place (2,)."""
    sensor = compose(x, mount)
    dx, dy = place - sensor[:2]
    d = max(math.hypot(dx, dy), 1e-6)
    h = np.array([d, float(wrap(math.atan2(dy, dx) - sensor[2]))])
    # How s moves with x: its place turns around the robot's middle.
    across, along = x[1] - sensor[1], sensor[0] - x[0]
    by_place = np.array([[-dx / d, -dy / d], [dy / d**2, -dx / d**2]])
    turning = by_place @ [across, along] + [0.0, -1.0]
    return h, np.column_stack([by_place, turning])
