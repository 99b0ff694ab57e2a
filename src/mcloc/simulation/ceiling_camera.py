"""What a camera that looks at the ceiling sees along a drive: noise, a gain and an offset that
drift, and people who cover the lens.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, uniform_filter
from scipy.signal import lfilter

from mcloc.events import Image
from mcloc.geometry import Poses, between
from mcloc.maps.mosaic import Mosaic
from mcloc.registry import Configurable, param

AT_ONCE = 1000  # images

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class CeilingCamera(Configurable):
    """A camera above the middle of the robot.

    The gain and the offset wander around 1 and 0, with `memory` as the time after which they have
    forgotten where they were. People cover the lens, by chance and each for a while: the image is
    dark then, or in a share `glow` of the times as light as a ceiling. Dust on the lens stays.
    """

    pixels: int = param(15, "", "along each side of the image", low=1, high=1000)
    pixel: float = param(0.1, "m", "side of a pixel on the ceiling", low=1e-3, high=10)
    noise: float = param(0.03, "", "deviation of a pixel, white being 1", low=0, high=1)
    gain: float = param(0.08, "", "deviation of the gain from 1", low=0, high=0.5)
    offset: float = param(0.02, "", "deviation of the offset from 0", low=0, high=0.5)
    memory: float = param(60.0, "s", "over which gain and offset change", low=0.1, high=1e6)
    covered: float = param(0.02, "", "share of the time that the lens is covered", low=0, high=0.9)
    covering: float = param(2.0, "s", "for which it is covered each time", low=0.1, high=1e4)
    glow: float = param(0.2, "", "share of these that are light, and not dark", low=0, high=1)
    dust: float = param(0.1, "", "deviation of what the lens lets through", low=0, high=1)

    def images(
        self,
        mosaic: Mosaic,
        t: Reals,
        poses: Poses,
        rng: np.random.Generator,
        odometry: Poses | None = None,
    ) -> Iterator[Image]:
        """An image at each stamp t (N,), evenly spaced, from the poses (N, 3), streaming.

        odometry: (N, 3) for the images. Where nobody knows the ceiling, it is black.
        """
        every = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
        gain, offset = (
            1.0 + self.gain * self._drift(len(t), every, rng),
            self.offset * self._drift(len(t), every, rng),
        )
        covered = self._covered(len(t), every, rng)
        side = self.pixels
        dust = np.clip(1.0 - np.abs(self.dust * rng.standard_normal((side, side))), 0.0, 1.0)
        table = self._seen(mosaic)
        for first in range(0, len(t), AT_ONCE):
            some = slice(first, first + AT_ONCE)
            seen = self._look(table, mosaic, poses[some]) * dust
            seen = gain[some, None, None] * seen + offset[some, None, None]
            hand = covered[some]
            seen[hand >= 0.0] = hand[hand >= 0.0][:, None, None]
            seen += self.noise * rng.standard_normal(seen.shape)
            np.clip(seen, 0.0, 1.0, out=seen)
            for k, pixels in enumerate(seen, start=first):
                at = None if odometry is None else odometry[k]
                yield Image(float(t[k]), pixels, odometry=at)

    def _seen(self, mosaic: Mosaic) -> Reals:
        """The mosaic, averaged over pixels of the camera."""
        known = np.nan_to_num(mosaic.image.astype(np.float64))
        width = max(round(self.pixel / mosaic.resolution), 1)
        return np.asarray(uniform_filter(known, width, mode="nearest"))

    def _look(self, table: Reals, mosaic: Mosaic, poses: Poses) -> Reals:
        """(n, side, side): brightness at the middle of each pixel."""
        off = self.pixel * (np.arange(self.pixels) - 0.5 * (self.pixels - 1))
        ahead, left = np.meshgrid(-off, -off, indexing="ij")
        local = between(mosaic.origin, poses)
        cos, sin = np.cos(local[:, 2])[:, None, None], np.sin(local[:, 2])[:, None, None]
        east = local[:, 0, None, None] + cos * ahead - sin * left
        north = local[:, 1, None, None] + sin * ahead + cos * left
        at = np.stack([north, east]) / mosaic.resolution - 0.5
        seen: Reals = map_coordinates(table, at, order=1, mode="constant", cval=0.0)
        return seen

    def _drift(self, n: int, every: float, rng: np.random.Generator) -> Reals:
        """(n,): a walk of deviation 1 that is drawn back to 0."""
        kept = np.exp(-every / self.memory)
        steps = np.sqrt(1.0 - kept**2) * rng.standard_normal(n)
        steps[:1] = rng.standard_normal(min(n, 1))
        walk: Reals = lfilter([1.0], [1.0, -kept], steps)
        return walk

    def _covered(self, n: int, every: float, rng: np.random.Generator) -> Reals:
        """(n,): brightness of what is over the lens, −1 for nothing."""
        hand = np.full(n, -1.0)
        if self.covered == 0.0:
            return hand
        free = self.covering * (1.0 - self.covered) / self.covered
        k = rng.exponential(free) / every
        while k < n:
            end = k + max(rng.exponential(self.covering) / every, 1.0)
            light = rng.random() < self.glow
            hand[int(k) : int(end)] = rng.uniform(0.15, 0.5) if light else rng.uniform(0.0, 0.03)
            k = end + rng.exponential(free) / every
        return hand
