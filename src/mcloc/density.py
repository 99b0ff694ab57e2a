"""Densities over states that particles are drawn from."""

import reprlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.draws import Draws, Stream
from mcloc.errors import ConfigError
from mcloc.geometry import wrap
from mcloc.statespace import LogWeights, States

FAR = 1e7  # m; no map reaches there, in UTM coordinates neither
WIDEST = 1e4, 2.0 * np.pi
"""m, rad: deviations beyond these say nothing about a robot on a map."""


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
        covariance that cannot be, also for deviations of more than 10⁴ m or 2π rad.
        """
        mean, spread = _numbers(pose), _numbers(covariance)
        if mean.shape != (3,) or not (np.abs(mean) < FAR).all():
            raise ConfigError(f"the {name} must be three finite numbers x, y, θ, got {_line(pose)}")
        about = f"the covariance of the {name} must be"
        if spread.shape != (3, 3) or not (np.abs(spread) < FAR**2).all():
            raise ConfigError(
                f"{about} (3, 3), finite, of x, y, θ in m, m, rad, got {_line(covariance)}"
            )
        if not np.allclose(spread, spread.T) or np.linalg.eigvalsh(spread)[0] <= 0.0:
            raise ConfigError(f"{about} symmetric and positive definite, got {_line(spread)}")
        farthest, turn = WIDEST
        if np.linalg.eigvalsh(spread[:2, :2])[1] > farthest**2 or spread[2, 2] > turn**2:
            raise ConfigError(
                f"{about} that of deviations up to {farthest:g} m and 2π rad, got {_line(spread)}"
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


def _numbers(told: ArrayLike) -> NDArray[np.float64]:
    """As an array, an empty one where these are no real numbers."""
    try:
        table = np.asarray(told)
    except ValueError:  # lists of several lengths
        return np.empty(0)
    return table.astype(np.float64) if table.dtype.kind in "iuf" else np.empty(0)


def _line(told: ArrayLike) -> str:
    """For a message, on one line."""
    listed = told.tolist() if isinstance(told, np.ndarray) else told
    return " ".join(reprlib.repr(listed).split())
