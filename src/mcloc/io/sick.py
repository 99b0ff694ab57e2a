"""The SICK LMS on the robots of CARMEN's time: where its beams point and what is no return."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

RANGE_MAX = 45.0
"""Metres. "No return" is coded as 81.83 … 81.91; single readings from 45 m on are no better."""


@lru_cache(maxsize=64)
def beam_angles(n: int) -> NDArray[np.float64]:
    """(n,) radians, from the right to the left.

    180 or 360 beams: from −90° on by 180°/n, the beam at +90° left out. Any other number (181 and
    361 among them): from −90° to +90°, both included.
    """
    if n in (180, 360):
        return np.arange(n, dtype=np.float64) * (np.pi / n) - np.pi / 2
    return np.linspace(-np.pi / 2, np.pi / 2, n)
