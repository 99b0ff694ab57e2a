"""What the particles of a node are: full states  [Est §3, Fig. 3 a]."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mcloc.filters.hierarchical.domain import Domain
from mcloc.filters.hierarchical.places import Places
from mcloc.filters.hierarchical.region import Region
from mcloc.protocols import Environment, MotionModel, SensorModel
from mcloc.statespace import States, StateSpace

Models = tuple[MotionModel, SensorModel, Environment]


class Description(Protocol):
    """What the particles of nodes are, and what the models are for them. axis: along which a node's
    region is halved.
    """

    @property
    def space(self) -> StateSpace:
        """The axes of a particle."""

    def models(self, region: Region, axis: int, motion: MotionModel, sensor: SensorModel) -> Models:
        """The models as such particles have them, and where those of a node can be."""

    def described(self, region: Region, axis: int, x: States) -> States:
        """(·, N): the particles that describe states (D, N)."""

    def half(self, region: Region, axis: int, particles: States) -> NDArray[np.int8]:
        """(N,): 0 or 1 for the half of the region, OUTSIDE for neither."""

    def states(self, region: Region, axis: int, particles: States) -> States:
        """(D, N): states that stand for particles."""

    def near(self, region: Region, particles: States) -> NDArray[np.bool_]:
        """(N,): which are in the region or near its border."""

    def collected(self, region: Region, particles: States) -> States:
        """(·, N): the same, those that are neither brought back to near the border."""


@dataclass(frozen=True, eq=False)
class FullStates:
    """Full description: a particle is a state. margin: (D,) in the axes' units, how far from a
    region's border is near it: about as far as a move leads.
    """

    domain: Domain
    margin: NDArray[np.float64]

    @property
    def space(self) -> StateSpace:
        """That of the domain."""
        return self.domain.whole.space

    def models(self, region: Region, axis: int, motion: MotionModel, sensor: SensorModel) -> Models:
        """The models as they are, and the whole domain: random particles are anywhere in it."""
        return motion, sensor, Places(self.domain, self.domain.whole)

    def described(self, region: Region, axis: int, x: States) -> States:
        """(D, N): the states."""
        return x

    def half(self, region: Region, axis: int, particles: States) -> NDArray[np.int8]:
        """(N,): by where they are."""
        return region.which_half(particles, axis)

    def states(self, region: Region, axis: int, particles: States) -> States:
        """(D, N): the particles."""
        return particles

    def near(self, region: Region, particles: States) -> NDArray[np.bool_]:
        """(N,): within the margin."""
        apart = np.abs(region.beyond(particles)) <= self.margin[:, None]
        near: NDArray[np.bool_] = np.logical_and.reduce(apart)
        return near

    def collected(self, region: Region, particles: States) -> States:
        """(D, N): brought back by whole margins."""
        return region.collected(particles, self.margin)
