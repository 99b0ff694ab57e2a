"""A node of the hierarchy: a sample set of its own, and what that says of its region  [Est §3]."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.filters.hierarchical.region import OUTSIDE, Region
from mcloc.particles import Particles
from mcloc.registry import Configurable, param
from mcloc.statespace import States


@dataclass(frozen=True, eq=False)
class Node:
    """particles: of whatever kind the hierarchy's description has. half: (N,) the half of the
    region that each is in, OUTSIDE for neither. states: (D, N) states that stand for them. updated:
    the step that updated it last.
    """

    region: Region
    particles: Particles
    half: NDArray[np.int8]
    states: States
    updated: int

    @cached_property
    def shares(self) -> tuple[float, float, float]:
        """How much of its belief is in the first half, in the second, and outside."""
        w = self.particles.weights
        first, second, outside = (float(w[self.half == half].sum()) for half in (0, 1, OUTSIDE))
        return first, second, outside

    @property
    def inside(self) -> float:
        """How much of it is in the region."""
        return self.shares[0] + self.shares[1]

    @property
    def likelier(self) -> int | None:
        """The half that has more of it, None where all of it is outside."""
        if self.inside <= 0.0:
            return None
        return int(self.shares[1] > self.shares[0])


@dataclass(frozen=True)
class Equal(Configurable):
    """m_d = m₀: as many particles for each node; a path of d + 1 nodes has m₀ (d + 1)  [Est §3]."""

    particles: int = param(1000, "", "particles of each node", low=1, high=1e7)

    def at(self, depth: int) -> int:
        """m_d."""
        return self.particles


@dataclass(frozen=True)
class Halving(Configurable):
    """m_d = m₀ / 2^d, but no fewer than a floor; without it a path of d + 1 nodes has m₀ (2 − 2^−d)
    [Est §3, where the formula has 1 for the 2].
    """

    particles: int = param(5000, "", "particles of the root", low=1, high=1e7)
    floor: int = param(6, "", "particles of a node, at least", low=1, high=1e7)

    def at(self, depth: int) -> int:
        """m_d."""
        return max(self.particles >> depth, self.floor)


Allocation = Equal | Halving
