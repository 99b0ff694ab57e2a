"""p(z | x) = p_detect N(z; h(x), σ² I) for z in the image, h(x) = (left, up) / ahead; what this
lacks to 1 is p(not seen | x)  [Fox01 §19.3.1, mono-camera imagery].
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from mcloc.registry import Configurable, param
from mcloc.statespace import LogWeights, States

NEAREST = 1e-6  # m; what is nearer is not ahead: its direction means nothing

Look = NDArray[np.float64] | None
"""(2,): where in the image an object was seen, in tangents of the angles left of the optical axis
and above it; None where it was not seen.
"""


@dataclass(frozen=True)
class ImageBearing(Configurable):
    """A camera at the robot's origin that looks ahead and sees in which direction an object is,
    never how far.

    x: (3, n) the object ahead, left and up of the camera, metres. An object ahead is detected with
    p_detect, and its image errs by σ = noise · width in both coordinates. Where that leads out of
    the image, or the object is not ahead, it is not seen: there is no other edge of the view. An
    object that is not ahead is never seen.
    """

    noise: float = param(0.1, "", "σ as a share of the image's width", low=1e-4, high=10)
    field_of_view: float = param(1.2, "rad", "angle across the image", above=0, high=3)
    aspect: float = param(0.75, "", "height of the image, its width being 1", above=0, high=10)
    p_detect: float = param(0.95, "", "chance that an object ahead is detected", above=0, high=1)

    @property
    def half(self) -> tuple[float, float]:
        """Half the image's width and height, in tangents."""
        half_width = math.tan(0.5 * self.field_of_view)
        return half_width, self.aspect * half_width

    @property
    def sigma(self) -> float:
        """σ, in tangents."""
        return 2.0 * self.noise * self.half[0]

    def log_likelihood(self, x: States, z: Look) -> LogWeights:
        """(n,): log p(z | x) per unit of area of the image; of no detection, a log probability."""
        ahead, h = projected(x)
        if z is None:
            return self._log_not_seen(h, ahead)
        if any(abs(z[k]) > self.half[k] for k in range(2)):
            return np.full(x.shape[1], -np.inf)
        norm = math.log(self.p_detect / (2.0 * math.pi * self.sigma**2))
        squares = ((h - z[:, None]) ** 2).sum(axis=0)
        log_p: LogWeights = np.where(ahead, norm - 0.5 * squares / self.sigma**2, -np.inf)
        return log_p

    def readings(self, z: Look) -> float:
        """1."""
        return 1.0

    def beams(self, z: Look) -> int:
        """1."""
        return 1

    def source(self, z: Look) -> str:
        """The only camera."""
        return "camera"

    def explained(self, x: States, z: Look) -> NDArray[np.float64]:
        """(n,): 1 where z is within 3 σ of the object's image in both coordinates, 0 elsewhere; NaN
        where nothing was seen.
        """
        if z is None:
            return np.full(x.shape[1], np.nan)
        ahead, h = projected(x)
        near = (np.abs(h - z[:, None]) <= 3.0 * self.sigma).all(axis=0)
        return np.where(near & ahead, 1.0, 0.0)

    def _log_not_seen(self, h: NDArray[np.float64], ahead: NDArray[np.bool_]) -> LogWeights:
        """log [1 − p_detect P(z in the image)], from the tails: they may be far below 1."""
        beside, above = (
            ndtr((h[k] - self.half[k]) / self.sigma) + ndtr((-h[k] - self.half[k]) / self.sigma)
            for k in range(2)
        )
        log_p: LogWeights
        missed = 1.0 - self.p_detect + self.p_detect * (beside + (1.0 - beside) * above)
        with np.errstate(divide="ignore"):
            log_p = np.where(ahead, np.log(missed), 0.0)
        return log_p


def projected(x: States) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """(n,): which objects are ahead; (2, n): h(x), for these."""
    ahead: NDArray[np.bool_] = x[0] >= NEAREST
    h: NDArray[np.float64] = x[1:] / np.where(ahead, x[0], 1.0)
    return ahead, h
