"""q̄(x) ≈ p(z | x) / π(z) of an image of the ceiling, by an index of the mosaic over brightness and
gradients: where it is as bright as the image, and rises as steeply in each direction, for one of
the ways in which the robot may be turned  [Fox01 Eq. 19.3.7].

    β ∝ exp(−½ (b − b_z)²/σ_b² − ½ w Σ_j (g_{j+k} − g_{z,j})²/σ_g²)

for a square of brightness b with gradients g in H directions, and the heading 2 π k / H.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws
from mcloc.events import Image
from mcloc.geometry import compose
from mcloc.maps.mosaic import Mosaic
from mcloc.maps.occupancy import FREE, OccupancyGrid
from mcloc.maps.occupancy import UNKNOWN as NOWHERE
from mcloc.protocols import Environment
from mcloc.registry import Configurable, param
from mcloc.samplers.found_poses import Found, FoundPoses
from mcloc.samplers.pose_boxes import PoseBoxes
from mcloc.sensors.ceiling import CeilingModel
from mcloc.sensors.ceiling_view import View
from mcloc.statespace import LogWeights, States

LOOKS = 4096  # poses for the estimate of π
LEAST = math.log(1e-6)  # of the likeliest box; those with less are left to U
NINTHS = (-1.0 / 3.0, 0.0, 1.0 / 3.0)

Singles = NDArray[np.float32]


@dataclass(frozen=True)
class CeilingIndex(Configurable):
    """Poses that an image of the ceiling may be from, found by how bright its middle is, and how
    steeply the brightness rises from there in `headings` directions.

    The mosaic is cut into squares of `spacing`; the index holds both for the middle of each in
    which a robot can be. An image is compared with all of them, for as many headings as there are
    directions, by the directions that it shows: a small one by its brightness alone. q̄ is spread
    evenly over each square and over the angle between two headings. Where the mosaic is unknown, a
    square counts like the average one. The directions see much of the same: together they are worth
    `effective` of them. A share `floor` of q̄ is U, which bounds importance weights wherever a robot
    can be; all of it is for images that say nothing.
    """

    sensor: CeilingModel
    environment: Environment
    spacing: float = param(0.25, "m", "side of a square", low=0.01, high=100)
    headings: int = param(12, "", "directions, and headings", low=4, high=256)
    radius: float = param(0.2, "m", "of the discs that brightness is a mean of", above=0, high=10)
    reach: float = param(0.5, "m", "over which a gradient is taken", low=0.01, high=100)
    sigma_brightness: float = param(
        0.12, "", "deviation of brightness, white being 1", above=0.001, high=1
    )
    sigma_gradient: float = param(0.12, "1/m", "deviation of a gradient", above=0.001, high=10)
    effective: float = param(12.0, "", "independent directions", above=0, high=100)
    floor: float = param(0.1, "", "share of poses from anywhere", above=0, high=1)

    def given(self, z: Image, draws: Draws) -> FoundPoses:
        """The density for one image; uniform where it says nothing, or the mosaic has no place."""

        def fit(x: States) -> LogWeights:
            return self.sensor.log_likelihood(x, z) + self.environment.log_prior(x)

        found = () if self.sensor.covered(z) else self._found(z)
        model = self.boxes, self.environment, found, self.floor, np.zeros(3)
        return FoundPoses(*model, fit, draws, LOOKS)

    def _found(self, z: Image) -> tuple[Found, ...]:
        """The boxes, at their one level."""
        told = self._told(z)
        squares, bright, rises = self._index
        if told is None or len(squares) == 0:
            return ()
        middle, gradients = told
        w = -0.5 * self.effective / (self.headings * self.sigma_gradient**2)
        shown = np.isfinite(gradients).astype(np.float32)
        gradients = np.nan_to_num(gradients)
        seen, turned = (
            np.stack([np.roll(each, k) for k in range(self.headings)], axis=1)
            for each in (shown, gradients)
        )
        square = rises**2 @ seen + np.float32(gradients @ gradients)
        log_w = np.float32(w) * (square - np.float32(2.0) * (rises @ turned))
        log_w -= (np.float32(0.5 / self.sigma_brightness**2) * (bright - middle) ** 2)[:, None]
        known = np.isfinite(log_w[:, 0])
        if not known.any():
            return ()
        most = float(log_w[known].max())
        weights = np.exp(log_w - most, where=known[:, None], out=np.zeros_like(log_w))
        weights[~known] = weights[known].mean()
        kept = np.flatnonzero(weights.ravel() >= math.exp(LEAST))
        mass = weights.ravel()[kept].astype(np.float64)
        row, heading = np.divmod(kept, self.headings)
        return (Found(0, squares[row] * self.headings + heading, mass / mass.sum()),)

    def _told(self, z: Image) -> tuple[np.float32, Singles] | None:
        """Brightness of the image's middle, and the gradient in each direction from ahead on, NaN
        where the image ends before, or a pixel is no number; None where the middle is none.
        """
        told = self._looking.means(z.pixels, self._around)
        if not np.isfinite(told[0]):
            return None
        gradients = (told[1:] - told[0]) / self.reach
        return np.float32(told[0]), gradients.astype(np.float32)

    @cached_property
    def _looking(self) -> View:
        return replace(self.sensor.looking, radius=self.radius)

    @cached_property
    def _around(self) -> NDArray[np.float64]:
        """(2, 1 + H): the middle, and a place in each direction, metres."""
        turn = 2.0 * np.pi * np.arange(self.headings) / self.headings
        ring = self.reach * np.stack([np.cos(turn), np.sin(turn)])
        return np.concatenate([np.zeros((2, 1)), ring], axis=1)

    @cached_property
    def boxes(self) -> PoseBoxes:
        """Squares of the mosaic, times the headings; free are those in which a robot can be."""
        mosaic = self.sensor.mosaic
        pixels = self.spacing / mosaic.resolution
        height, width = (math.ceil(n / pixels - 1e-9) for n in mosaic.image.shape)
        shape = height, width
        row, column = np.indices(shape).reshape(2, -1) + 0.5
        found = np.zeros(len(row), dtype=np.bool_)
        for a in NINTHS:
            for b in NINTHS:
                local = np.stack([column + a, row + b, np.zeros(len(row))], axis=-1)
                local[:, :2] *= self.spacing
                x = np.ascontiguousarray(compose(mosaic.origin, local).T)
                found |= self.environment.log_density(x) > -np.inf
        cells = np.where(found.reshape(shape), FREE, NOWHERE).astype(np.int8)
        grid = OccupancyGrid(cells, self.spacing, mosaic.origin, name=mosaic.name)
        return PoseBoxes(grid, 1, self.headings)

    @cached_property
    def _index(self) -> tuple[NDArray[np.int64], Singles, Singles]:
        """(S,) squares, (S,) how bright each is in its middle, and (S, H) how steep, by directions
        from the mosaic's own x axis on.
        """
        squares, middles = self.boxes.free_squares()
        mosaic: Mosaic = self.sensor.mosaic.averaged(self.radius)
        bright = mosaic.at(middles)
        rises = np.empty((len(squares), self.headings), dtype=np.float32)
        cos, sin = np.cos(mosaic.origin[2]), np.sin(mosaic.origin[2])
        for j, (along, across) in enumerate(self._around[:, 1:].T):
            east, north = cos * along - sin * across, sin * along + cos * across
            beside = mosaic.at(middles[:2] + np.array([[east], [north]]))
            rises[:, j] = (beside - bright) / self.reach
        return squares, bright.astype(np.float32), rises
