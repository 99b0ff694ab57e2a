"""Exact ranges to discs: d·c − √(r² − |d × c|²), d a beam's direction, c a centre seen from it."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.geometry import Poses


def ranges_to_discs(
    sensor_poses: Poses,
    angles: NDArray[np.float64],
    range_max: float,
    centres: ArrayLike,
    radius: float,
) -> NDArray[np.float64]:
    """(N, B) metres from each sensor to the first disc on each beam, inf where none is in reach.

    sensor_poses: (N, 3). angles: (B,) radians in the sensor's frame. centres: (P, N, 2) of the
    discs while the sensor is at each of its poses, in the same frame; NaN for one that is not
    there. A sensor inside a disc measures 0.
    """
    nearest = np.full((len(sensor_poses), len(angles)), np.inf)
    for centre in np.asarray(centres, dtype=np.float64):
        x, y = (centre - sensor_poses[:, :2]).T
        distance = np.hypot(x, y)
        near = distance < range_max + radius
        x, y, distance = x[near, None], y[near, None], distance[near, None]
        angle = sensor_poses[near, 2, None] + angles
        cos, sin = np.cos(angle), np.sin(angle)
        along, across = x * cos + y * sin, x * sin - y * cos
        within = radius**2 - across**2
        length = along - np.sqrt(np.maximum(within, 0.0))
        length = np.where((within >= 0.0) & (along > 0.0), length, np.inf)
        length = np.where(distance <= radius, 0.0, length)
        nearest[near] = np.minimum(nearest[near], np.where(length < range_max, length, np.inf))
    return nearest
