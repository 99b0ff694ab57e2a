"""StateSpace: what the axes of a state are. Densities, bins and resampling know no more than
this.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

States = NDArray[np.float64]
"""Shape (D, N): one contiguous row for each axis, one column for each particle."""

LogWeights = NDArray[np.float64]
"""Shape (N,): natural logarithms; −inf is a weight of zero."""


@dataclass(frozen=True, slots=True)
class StateSpace:
    """Names, units and kinds of the axes. A circular axis is an angle in (−π, π]."""

    axes: tuple[str, ...]
    units: tuple[str, ...]
    circular: tuple[bool, ...]

    @property
    def dimension(self) -> int:
        """D."""
        return len(self.axes)


SE2 = StateSpace(("x", "y", "theta"), ("m", "m", "rad"), (False, False, True))
"""Poses in the plane, map frame."""

R3 = StateSpace(("x", "y", "z"), ("m", "m", "m"), (False, False, False))
"""Points in space."""

LINE = StateSpace(("x",), ("m",), (False,))
"""Places along a line; tiles are its whole numbers."""

PLANE = StateSpace(("x", "y"), ("m", "m"), (False, False))
"""Places in the plane; 2-D tiles are its whole numbers."""
