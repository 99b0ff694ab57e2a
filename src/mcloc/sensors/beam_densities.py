"""p(z | e): how the reading of one beam comes about, e being the range that the map lets expect.

Each function is a density over the same mixed measure, broadcast over its arguments and of integral
1 for every e: for z < range_max the density per metre, and for z = range_max, which stands for no
return, the probability of it. All in metres; e = inf where no wall is within reach.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

Array = NDArray[np.float64]


def hit(z: Array, e: Array, range_max: float, sigma: float | Array) -> Array:
    """The expected wall, with Gaussian noise: N(z; e, σ²) of what is > 0; what is above range_max
    gives no return  [Probabilistic Robotics, Eq. 6.4, which has no such readings].

    sigma: one deviation, or one for each e.
    """
    within = np.exp(-0.5 * ((z - e) / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi))
    density: Array = np.where(z < range_max, within, ndtr((e - range_max) / sigma)) / ndtr(
        e / sigma
    )
    return density


def short(z: Array, e: Array, range_max: float, rate: float) -> Array:
    """Something before the wall: λ exp(−λ z) on [0, e), normalized  [Probabilistic Robotics,
    Eq. 6.6]. e must be > 0.
    """
    until = np.minimum(e, range_max)
    density: Array = np.where(z < until, rate * np.exp(-rate * z) / -np.expm1(-rate * until), 0.0)
    return density


def miss(z: Array, e: Array, range_max: float, rate: float) -> Array:
    """The wall was not seen: λ exp(−λ (z − e)) beyond it, and above range_max no return."""
    beyond = np.exp(-rate * np.maximum(z - e, 0.0))
    inside = np.where(z >= e, rate * beyond, 0.0)
    density: Array = np.where(z < range_max, inside, beyond)
    return density


def no_return(z: Array, range_max: float) -> Array:
    """range_max for certain  [Probabilistic Robotics, Eq. 6.7]."""
    return np.where(z < range_max, 0.0, 1.0)


def uniform(z: Array, range_max: float) -> Array:
    """Anything below range_max  [Probabilistic Robotics, Eq. 6.8]."""
    return np.where(z < range_max, 1.0 / range_max, 0.0)


def exponential(z: Array, range_max: float, rate: float) -> Array:
    """Something anywhere, more likely near: λ exp(−λ z) on [0, range_max), normalized."""
    return short(z, np.array(range_max), range_max, rate)
