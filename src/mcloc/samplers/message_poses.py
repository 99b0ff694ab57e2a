"""q̄(x) = ε U(x) + (1 − ε) T(x) of a message: poses where another robot says that this one is
[Fox01 §19.4.1].
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mcloc.density_tree import DensityTree
from mcloc.draws import Draws, Stream
from mcloc.events import Message
from mcloc.protocols import Environment, PoseDensity
from mcloc.samplers.found_poses import log_pi_of
from mcloc.sensors.messages import MessageModel, tree_of
from mcloc.statespace import LogWeights, States

LOOKS = 2000  # poses that π is estimated from


@dataclass(frozen=True)
class MessagePoses:
    """Poses of a robot by what another one told. Where its tree knows no heading, all headings are
    alike. A share `floor` of q̄ is U, all of it where nothing is told: it bounds importance weights
    wherever a robot can be.
    """

    sensor: MessageModel
    environment: Environment
    floor: float = 0.1

    def given(self, z: Message, draws: Draws) -> PoseDensity:
        """q̄ for one message."""
        floor = self.floor if z.useful else 1.0
        return ToldPoses(self.sensor, self.environment, floor, z, tree_of(z), draws)


@dataclass(frozen=True, eq=False)
class ToldPoses:
    """q̄ for one message z with its tree; ε = floor. draws: for the estimate of π; those of samples
    must be others.
    """

    sensor: MessageModel
    environment: Environment
    floor: float
    z: Message
    tree: DensityTree
    draws: Draws

    def sample(self, draws: Draws, first: int, n: int) -> States:
        """(3, n): poses of the particles first … first + n − 1, map frame."""
        x = self.environment.sample(draws, first, n)
        told = draws.uniform(Stream.CHOICE, first, n)[2] >= self.floor
        there = self.tree.sample(draws, first, n)
        x[: len(there), told] = there[:, told]
        if len(there) == 2:  # its three numbers leave one of each block of four
            heading = np.pi - 2.0 * np.pi * draws.uniform(Stream.TREE, first, n)[3]
            x[2, told] = heading[told]
        return x

    def log_density(self, x: States) -> LogWeights:
        """(n,): log q̄ at each column of x (3, n); −inf only where neither T nor U has any."""
        density = self.floor * np.exp(self.environment.log_density(x))
        if self.floor < 1.0:
            around = 2.0 * math.pi if len(self.z.low) == 2 else 1.0
            told = np.exp(self.tree.log_density(x[: len(self.z.low)]))
            density += (1.0 - self.floor) / around * told
        with np.errstate(divide="ignore"):
            log: LogWeights = np.log(density)
        return log

    @cached_property
    def log_pi(self) -> float:
        """log π, π = ∫ p(z | x) p(x | m) dx, as an importance sample of q̄ gives it; worked out when
        it is first asked for.
        """
        return log_pi_of(self, self._fit, self.draws, LOOKS)

    def _fit(self, x: States) -> LogWeights:
        log_p: LogWeights = self.sensor.log_likelihood(x, self.z) + self.environment.log_prior(x)
        return log_p
