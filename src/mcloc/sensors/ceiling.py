"""p(z | x) of a camera that looks at the ceiling, against a mosaic of it: by the brightness right
above the robot  [Fox01 §19.2.5; Fox99; Dellaert, Burgard, Fox, Thrun: CVPR 1999].
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from mcloc.events import Image
from mcloc.maps.mosaic import Mosaic
from mcloc.registry import Configurable, param
from mcloc.sensors.ceiling_view import Reals, View
from mcloc.statespace import LogWeights, States

NOTHING = 1e-9  # readings that an image which says nothing is worth: it must be > 0
MIDDLE = np.zeros((2, 1))  # m, of the robot


@dataclass(frozen=True)
class CeilingModel(Configurable, ABC):
    """What all models of ceiling cameras share: how an image lies above the robot, and when it says
    nothing.

    People cover the lens. An image whose middle is darker than `dark` is none: it has the chance
    p_blackout wherever the robot is, and so weighs nothing. Nor do images whose middle is no
    number.
    """

    mosaic: Mosaic
    pixel: float = param(0.1, "m", "side of an image's pixel on the ceiling", above=0, high=10)
    view: str = param(
        "above",
        "",
        "images as seen from above, like a map, or from below, as the camera sees them",
        choices=("above", "below"),
    )
    turn: float = param(
        0.0, "rad", "from the robot's heading to where the first row lies", low=-7, high=7
    )
    radius: float = param(0.15, "m", "of the discs that brightness is a mean of", above=0, high=10)
    dark: float = param(0.05, "", "brightness below which the lens is covered", low=0, high=0.9)
    p_blackout: float = param(0.05, "", "chance of a covered lens", above=0, high=0.99)
    p_outlier: float = param(
        0.1, "", "ε: chance that an image is of something else", above=0, high=1
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self.expected._table  # noqa: B018 - ready before threads ask for it

    @abstractmethod
    def log_likelihood(self, x: States, z: Image) -> LogWeights:
        """(n,): log p(z | x)."""

    @abstractmethod
    def beams(self, z: Image) -> int:
        """At how many places a pose is compared with z."""

    @abstractmethod
    def covered(self, z: Image) -> bool:
        """Whether z says nothing."""

    @cached_property
    def expected(self) -> Mosaic:
        """The mosaic, averaged over discs as images are."""
        return self.mosaic.averaged(self.radius)

    @cached_property
    def looking(self) -> View:
        """How images lie above the robot."""
        return View(self.pixel, self.view == "below", self.turn, self.radius)

    def told(self, z: Image, points: Reals) -> Reals:
        """(P,): brightness of z at the points (2, P), metres in the robot's frame; NaN where it is
        no number, or the image ends before.
        """
        return self.looking.means(z.pixels, points)

    def within(self, z: Image, points: Reals) -> Reals:
        """The same. Raises ConfigError where the image ends before."""
        height, width = z.pixels.shape
        if not self.looking.within(z.pixels.shape, points).all():
            reach = 2.0 * (float(np.abs(points).max()) + self.radius)
            raise self.wrong(
                f"pixel = {self.pixel:g} m: an image of {height} × {width} pixels is smaller than "
                f"the {reach:g} m of ceiling that are looked at; set it to what a pixel covers, or "
                "make camera.radius or camera.side smaller"
            )
        return self.told(z, points)

    def middle(self, z: Image) -> float:
        """Brightness right above the robot, NaN where it is no number."""
        return float(self.within(z, MIDDLE)[0])

    def source(self, z: Image) -> str:
        """The camera's name."""
        return z.source


@dataclass(frozen=True)
class CeilingBrightness(CeilingModel):
    """The brightness b right above the robot, a single number:

        p(b | x) = (1 − p_blackout) [(1 − ε) N(b; e, σ(e)²) / Z + ε / (1 − dark)],  b > dark,
        σ(e)² = σ_noise² + (σ_gain e)² + σ_offset²,

    e the mosaic's brightness at x, Z the part of the normal density between `dark` and white. A
    camera's gain and offset drift, with its exposure and with the light: they are around 1 and 0,
    and not known better. Where the mosaic is unknown, any brightness is as likely as any other.
    """

    sigma_noise: float = param(
        0.08, "", "deviation of the brightness of a disc, white being 1", above=0, high=1
    )
    sigma_gain: float = param(0.1, "", "deviation of the gain from 1", low=0, high=1)
    sigma_offset: float = param(0.03, "", "deviation of the offset from 0", low=0, high=1)

    def sigma(self, e: Reals) -> Reals:
        """σ(e)."""
        square: Reals = self.sigma_noise**2 + self.sigma_offset**2 + (self.sigma_gain * e) ** 2
        return np.sqrt(square)

    def density(self, b: Reals | float, e: Reals) -> Reals:
        """p(b | e), broadcast, for dark < b ≤ 1; e NaN where it is unknown. What its integral over
        b lacks to 1 is p_blackout, the chance that there is no b.
        """
        any_ = 1.0 / (1.0 - self.dark)
        known = np.where(np.isnan(e), 0.5, e)
        sigma = self.sigma(known)
        left = ndtr((1.0 - known) / sigma) - ndtr((self.dark - known) / sigma)
        off = (b - known) / sigma
        normal = np.exp(-0.5 * off * off) / (math.sqrt(2.0 * math.pi) * sigma * left)
        mixed = (1.0 - self.p_outlier) * normal + self.p_outlier * any_
        density: Reals = (1.0 - self.p_blackout) * np.where(np.isnan(e), any_, mixed)
        return density

    def log_likelihood(self, x: States, z: Image) -> LogWeights:
        """(n,): log p(z | x) × novelty, relative to the p of a ceiling just as bright: about 0
        where it is. 0 for a covered lens.
        """
        b = self.middle(z)
        if not b > self.dark:
            return np.zeros(x.shape[1])
        p = self.density(min(b, 1.0), self.expected.at(x))
        best = float(self.density(min(b, 1.0), np.array(b)))
        log_p: LogWeights = z.novelty * np.log(p / best)
        return log_p

    def covered(self, z: Image) -> bool:
        """Whether the middle is dark, or no number."""
        return not self.middle(z) > self.dark

    def readings(self, z: Image) -> float:
        """One reading, as far as it is news; next to nothing for a covered lens."""
        return NOTHING if self.covered(z) else z.novelty

    def beams(self, z: Image) -> int:
        """One place."""
        return 1

    def explained(self, x: States, z: Image) -> NDArray[np.float64]:
        """(n,): 1 within 3 σ of what the mosaic shows, else 0; NaN for a covered lens."""
        if self.covered(z):
            return np.full(x.shape[1], np.nan)
        e = self.expected.at(x)
        with np.errstate(invalid="ignore"):
            near = np.abs(self.middle(z) - e) <= 3.0 * self.sigma(e)
        return near.astype(np.float64)
