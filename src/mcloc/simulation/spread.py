"""Places far from each other, chosen among many."""

import numpy as np
from numpy.typing import NDArray


def spread(places: NDArray[np.float64], n: int) -> list[int]:
    """Indices of n of the places (K, 2), metres: the first one, and again and again the one that
    is farthest from those before.
    """
    chosen = [0]
    away = np.hypot(*(places - places[0]).T)
    while len(chosen) < n:
        chosen.append(int(away.argmax()))
        away = np.minimum(away, np.hypot(*(places - places[chosen[-1]]).T))
    return chosen
