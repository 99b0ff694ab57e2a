"""A mosaic of a ceiling: its brightness over the floor that lies under it  [Fox01 Fig. 19.7]."""

import hashlib
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import fftconvolve

from mcloc.errors import MapError
from mcloc.geometry import Pose, compose
from mcloc.kernels.jit import share
from mcloc.kernels.mosaic import look_up_brightness, match_patch
from mcloc.maps.occupancy import FARTHEST, FREE, LARGEST_CELL, LEAST_CELL, OccupancyGrid
from mcloc.statespace import States

_WORK = 30.0  # ns a place

Reals = NDArray[np.float64]
Frame = tuple[int, int, float, float, float, float, float]


@dataclass(frozen=True, eq=False)
class Mosaic:
    """image: (H, W) float32, brightness 0 … 1, row 0 lowest in y, column 0 lowest in x (of the
    mosaic's own frame); NaN where nobody knows it. resolution: metres a pixel. origin: (3,) pose of
    the outer corner of pixel (0, 0) in the map frame; its θ turns the mosaic.

    Brightness is that of a pixel in its middle, and bilinear between the middles of four; a place
    is unknown where one of the four is. Raises MapError for a table that is no image, or has no
    frame.
    """

    image: NDArray[np.float32]
    resolution: float
    origin: Pose
    name: str = "mosaic"

    def __post_init__(self) -> None:
        image = np.ascontiguousarray(self.image, dtype=np.float32)
        origin = np.array(self.origin, dtype=np.float64)
        if image.ndim != 2 or min(image.shape) < 2:
            raise MapError(
                f"{self.name}: a mosaic needs at least 2 × 2 pixels of brightness, got shape "
                f"{image.shape}"
            )
        known = image[np.isfinite(image)]
        if known.size == 0:
            raise MapError(f"{self.name}: the brightness of no pixel is known")
        if known.min() < 0.0 or known.max() > 1.0:
            raise MapError(
                f"{self.name}: brightness must be from 0 to 1, got {known.min():g} … "
                f"{known.max():g}; divide by the value of white"
            )
        if not LEAST_CELL <= self.resolution <= LARGEST_CELL:
            raise MapError(
                f"{self.name}: resolution must be from {LEAST_CELL} to {LARGEST_CELL} m/pixel, "
                f"got {self.resolution}"
            )
        if origin.shape != (3,) or not (np.abs(origin) < FARTHEST).all():
            raise MapError(
                f"{self.name}: origin must be [x, y, yaw], less than {FARTHEST:g} m away, got "
                f"{self.origin}"
            )
        image = np.where(np.isfinite(image), image, np.float32(np.nan))
        object.__setattr__(self, "image", image)
        object.__setattr__(self, "origin", origin)

    @classmethod
    def load(
        cls,
        path: str | Path,
        resolution: float | None = None,
        origin: ArrayLike | None = None,
    ) -> "Mosaic":
        """The mosaic of a YAML file with image, resolution and origin, as ROS maps have it; or of
        an image, where these two are given. Raises MapError.
        """
        from mcloc.maps.mosaic_file import read

        return read(path, resolution, origin)

    def save(self, path: str | Path) -> None:
        """Write a YAML file and a PNG of 16 bits, or of 8 where some of it is unknown, beside it.
        Raises MapError.
        """
        from mcloc.maps.mosaic_file import write

        write(self, Path(path))

    @cached_property
    def checksum(self) -> str:
        """SHA-256 of everything but the name."""
        digest = hashlib.sha256(self.image.tobytes())
        digest.update(np.array([*self.image.shape, self.resolution, *self.origin]).tobytes())
        return digest.hexdigest()

    def covers(self, grid: OccupancyGrid) -> bool:
        """Whether its brightness is known anywhere above the free cells of a map."""
        row, column = np.nonzero(grid.cells == FREE)
        local = grid.resolution * np.stack([column + 0.5, row + 0.5, np.zeros(len(row))], axis=-1)
        places = np.ascontiguousarray(compose(grid.origin, local).T)
        return bool(np.isfinite(self.at(places)).any())

    def at(self, places: States) -> Reals:
        """(n,): brightness above places (2, n) or poses (3, n), metres, map frame; NaN where it is
        unknown.
        """
        out = np.empty(places.shape[1])
        of_all = np.ascontiguousarray(places, dtype=np.float64), *self._table, out
        share(lambda a, b: look_up_brightness(*of_all, a, b), len(out), _WORK * len(out))
        return out

    def match(self, x: States, points: Reals, pattern: Reals) -> tuple[Reals, Reals]:
        """Σ_k v_k d_k and Σ_k d_k², each (n,), for the pattern v (P,), whose mean is 0. d_k is how
        much brighter the mosaic is at point k than at all points in the mean, when the robot is at
        x (3, n); where it is unknown at a point, d_k = 0, and the mean is that of the others.

        points: (2, P) metres, robot frame.
        """
        dots, squares = np.empty((2, x.shape[1]))
        of_all = np.ascontiguousarray(x, dtype=np.float64), points, pattern, *self._table

        def run(start: int, stop: int) -> None:
            match_patch(*of_all, dots, squares, start, stop)

        share(run, len(dots), (_WORK + 5.0 * len(pattern)) * len(dots))
        return dots, squares

    def averaged(self, radius: float) -> "Mosaic":
        """The same with each pixel the mean of what is known within `radius` metres of its middle;
        what was unknown stays so.
        """
        reach = int(radius / self.resolution)
        off = self.resolution * np.arange(-reach, reach + 1)
        disc = (np.hypot(off, off[:, None]) <= radius).astype(np.float64)
        if disc.sum() < 2:
            return self
        known = np.isfinite(self.image)
        total = fftconvolve(np.where(known, self.image, 0.0).astype(np.float64), disc, "same")
        count = np.rint(fftconvolve(known.astype(np.float64), disc, "same"))
        mean = np.clip(total / np.maximum(count, 1.0), 0.0, 1.0)
        return replace(self, image=np.where(known, mean, np.nan).astype(np.float32))

    @cached_property
    def _table(self) -> tuple[NDArray[np.float32], Frame]:
        """The pixels within a ring of NaN, and their frame, as the kernels take them."""
        table = np.pad(self.image, 1, constant_values=np.nan)
        (ox, oy, yaw), pixel = self.origin, self.resolution
        cos, sin = float(np.cos(yaw)), float(np.sin(yaw))
        corner = float(ox) - pixel * (cos - sin), float(oy) - pixel * (sin + cos)
        return table.ravel(), (*table.shape, *corner, cos, sin, 1.0 / pixel)
