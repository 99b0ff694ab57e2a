"""What a ceiling camera's image says at places around the robot: means over small discs."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

RINGS = 3  # of a disc, of 6, 12, 18 places

Reals = NDArray[np.float64]
Weights = tuple[csr_array, NDArray[np.bool_]]


def disc(radius: float) -> Reals:
    """(2, 37): places spread evenly over a disc around 0, metres."""
    places = [(0.0, 0.0)]
    for ring in range(1, RINGS + 1):
        turn = 2.0 * math.pi * np.arange(6 * ring) / (6 * ring)
        # So many places lie within the circle on which half of the ring's do.
        r = radius * math.sqrt((1.0 + 3.0 * ring * ring) / (1.0 + 3.0 * RINGS * (RINGS + 1)))
        places += zip((r * np.cos(turn)).tolist(), (r * np.sin(turn)).tolist(), strict=True)
    return np.array(places).T


@dataclass(frozen=True, eq=False)
class View:
    """How images lie above the robot, whose centre is below their middle.

    pixel: side of a pixel on the ceiling, m. mirrored: whether the first column is to the robot's
    right. turn: rad, from the robot's heading to where the first row lies. radius: of the discs, m.
    """

    pixel: float
    mirrored: bool
    turn: float
    radius: float

    def means(self, pixels: Reals, points: Reals) -> Reals:
        """(P,): brightness around the points (2, P), metres in the robot's frame; NaN for discs
        that are not within the image, or of which a pixel is no number.
        """
        weights, inside = self._weights(pixels.shape, points)
        told: Reals = np.where(inside, weights @ np.ravel(pixels), np.nan)
        return told

    def within(self, shape: tuple[int, ...], points: Reals) -> NDArray[np.bool_]:
        """(P,): which discs are within an image of this shape."""
        return self._weights(shape, points)[1]

    def _weights(self, shape: tuple[int, ...], points: Reals) -> Weights:
        """(P, H · W): of each pixel in the mean over each disc; and which discs are within."""
        asked = shape, points.tobytes()
        if asked not in self._known:
            self._known[asked] = self._worked_out(shape, points)
        return self._known[asked]

    def _worked_out(self, shape: tuple[int, ...], points: Reals) -> Weights:
        (height, width), count = shape, points.shape[1]
        around = disc(self.radius)
        ahead, left = (points[:, :, None] + around[:, None, :]).reshape(2, -1)
        up = math.cos(self.turn) * ahead + math.sin(self.turn) * left
        aside = math.cos(self.turn) * left - math.sin(self.turn) * ahead
        row = 0.5 * (height - 1) - up / self.pixel
        column = 0.5 * (width - 1) + (aside if self.mirrored else -aside) / self.pixel
        half = 0.5 + 1e-9
        inside = (np.abs(row - 0.5 * (height - 1)) <= 0.5 * (height - 1) + half) & (
            np.abs(column - 0.5 * (width - 1)) <= 0.5 * (width - 1) + half
        )
        row, column = np.clip(row, 0.0, height - 1.0), np.clip(column, 0.0, width - 1.0)
        i, j = (np.minimum(v.astype(np.intp), n - 1) for v, n in ((row, height), (column, width)))
        b, a = row - i, column - j
        places, share = around.shape[1], 1.0 / around.shape[1]
        of, at, much = [], [], []
        for di, dj, weight in (
            (0, 0, (1.0 - b) * (1.0 - a)),
            (0, 1, (1.0 - b) * a),
            (1, 0, b * (1.0 - a)),
            (1, 1, b * a),
        ):
            counts = weight > 0.0
            of.append(np.repeat(np.arange(count), places)[counts])
            at.append(((i + di) * width + j + dj)[counts])
            much.append(share * weight[counts])
        where = np.concatenate(of), np.concatenate(at)
        table = csr_array((np.concatenate(much), where), shape=(count, height * width))
        return table, np.asarray(inside.reshape(count, places).all(axis=1))

    @cached_property
    def _known(self) -> dict[tuple[tuple[int, ...], bytes], Weights]:
        """Images of one camera have one shape."""
        return {}
