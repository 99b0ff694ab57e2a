"""Trajectory: poses with stamps, as estimated, as measured by wheels, or as the truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.geometry import Poses, interpolate


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses in one frame in strictly increasing order of time.

    t: (N,) seconds. poses: (N, 3) metres and radians. covariances: (N, 3, 3) of (x, y, θ), or None.
    share: (N,) the mass of the hypothesis that each pose is the mean of, or None.
    """

    t: NDArray[np.float64]
    poses: Poses
    covariances: NDArray[np.float64] | None = None
    share: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.t)

    def at(self, t: NDArray[np.float64]) -> Poses:
        """(M, 3): poses interpolated to the stamps t, the first and last held outside."""
        right = np.clip(np.searchsorted(self.t, t), 1, max(len(self.t) - 1, 1))
        if len(self.t) == 1:
            return np.repeat(self.poses, len(t), axis=0)
        left = right - 1
        span = self.t[right] - self.t[left]
        fraction = np.clip((t - self.t[left]) / span, 0.0, 1.0)
        return interpolate(self.poses[left], self.poses[right], fraction)
