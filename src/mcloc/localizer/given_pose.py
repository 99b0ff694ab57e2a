"""A pose that somebody says: a density, where a robot can stand."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.density import Gaussian
from mcloc.errors import ConfigError
from mcloc.maps.occupancy import OccupancyGrid


def covariance_of(sigma: ArrayLike) -> NDArray[np.float64]:
    """(3, 3): the covariance of independent deviations. Raises ConfigError unless they are > 0."""
    deviation = np.asarray(sigma, dtype=np.float64)
    if deviation.shape != (3,) or not ((deviation > 0) & (deviation < 1e6)).all():
        raise ConfigError(f"the initial sigma must be three numbers > 0 (m, m, rad), got {sigma!r}")
    return np.diag(deviation**2)


def given_pose(grid: OccupancyGrid, name: str, pose: ArrayLike, covariance: ArrayLike) -> Gaussian:
    """The belief of somebody who was told a pose. Raises ConfigError where a robot cannot stand."""
    density = Gaussian.told(name, pose, covariance)
    x, y, _ = density.mean
    place = grid.state_at(density.mean)
    if place in ("outside", "occupied"):
        where = "outside the map" if place == "outside" else "inside a wall"
        raise ConfigError(
            f"the {name} ({x:g}, {y:g}) m is {where} {grid.name}, which covers {grid.extent()}"
        )
    return density
