"""Densities over states that particles are drawn from."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.draws import Draws, Stream
from mcloc.errors import ConfigError
from mcloc.geometry import wrap
from mcloc.statespace import LogWeights, States

FAR = 1e6  # m; no map reaches there


@dataclass(frozen=True, eq=False)
class Gaussian:
    """The density around a given pose. mean: (3,) m, m, rad. covariance: (3, 3), positive
    definite.
    """

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]

    @classmethod
    def told(cls, name: str, pose: ArrayLike, covariance: ArrayLike) -> "Gaussian":
        """What somebody said. name: of the pose, for messages. Raises ConfigError for a pose or a
        covariance that cannot be.
        """
        mean, spread = np.asarray(pose, dtype=np.float64), np.asarray(covariance, dtype=np.float64)
        if mean.shape != (3,) or not (np.abs(mean) < FAR).all():
            raise ConfigError(f"the {name} must be three finite numbers x, y, θ, got {pose!r}")
        if spread.shape != (3, 3) or not (np.abs(spread) < FAR**2).all():
            raise ConfigError(
                f"the covariance of the {name} must be (3, 3), finite, of x, y, θ in m, m, rad, "
                f"got {covariance!r}"
            )
        if not np.allclose(spread, spread.T) or np.linalg.eigvalsh(spread)[0] <= 0.0:
            raise ConfigError(
                f"the covariance of the {name} must be symmetric and positive definite, got "
                f"{spread.tolist()}"
            )
        return cls(mean, spread)

    @cached_property
    def _root(self) -> NDArray[np.float64]:
        """(3, 3) lower triangle L with L Lᵀ the covariance."""
        return np.linalg.cholesky(self.covariance).astype(np.float64)

    def sample(self, draws: Draws, first: int, n: int) -> States:
        """(3, n): poses of the particles first … first + n − 1."""
        normal = draws.normal(Stream.RANDOM_POSE, first, n)
        # Not a matrix product: BLAS may add in another order for another n.
        x: States = self.mean[:, None] + sum(self._root[:, k, None] * normal[k] for k in range(3))
        x[2] = wrap(x[2])
        return x

    def log_density(self, x: States) -> LogWeights:
        """(n,): log density per m² rad, for deviations in θ that do not reach around the circle."""
        e = x - self.mean[:, None]
        e[2] = wrap(e[2])
        scaled = np.linalg.solve(self._root, e)
        norm = float(np.log(np.diag(self._root) * np.sqrt(2.0 * np.pi)).sum())
        density: LogWeights = -0.5 * (scaled**2).sum(axis=0) - norm
        return density
