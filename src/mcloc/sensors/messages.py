"""p(z | x) of what another robot told: (1 − ε) T(x) + ε p_even, T a density tree of where this one
is  [Fox01 Eq. 19.4.18, 19.4.19].
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mcloc.density_tree import DensityTree
from mcloc.errors import ConfigError
from mcloc.events import Message
from mcloc.maps.teammates import Teammates
from mcloc.registry import Configurable
from mcloc.statespace import PLANE, SE2, LogWeights, States

NOWHERE = DensityTree(
    PLANE,
    floor=0.0,
    low=np.zeros(2),
    side=np.ones(2),
    axis=np.zeros(1, dtype=np.uint64),
    split=np.full(1, np.nan),
    child=np.zeros(1, dtype=np.uint64),
    corner=np.zeros((1, 2)),
    width=np.ones((1, 2)),
    weight=np.ones(1),
)
"""The tree of a message that says nothing."""


@dataclass(frozen=True)
class MessageModel(Configurable):
    """Messages of other robots, each with a density tree of places or of poses.

    What a tree is wrong by, and the detection behind it, is in its ε and p_even. A false detection
    says nothing: log p is relative to it. What is no news counts less: it is tempered by the
    message's novelty, as scans from one place are. Raises ConfigError for trees of other axes than
    the states have.
    """

    teammates: Teammates

    def log_likelihood(self, x: States, z: Message) -> LogWeights:
        """(n,): log of p(z | x) / p_even to the power of the novelty, 0 where z says nothing."""
        if not z.useful:
            return np.zeros(x.shape[1])
        told = self.log_told(x, z) + math.log1p(-z.p_false) - math.log(z.even)
        false = math.log(z.p_false) if z.p_false > 0.0 else -math.inf
        log_p: LogWeights = z.novelty * np.logaddexp(told, false)
        return log_p

    def log_told(self, x: States, z: Message) -> LogWeights:
        """(n,): log T(x), of the place where T knows no heading."""
        if len(x) < len(z.low):
            raise ConfigError(
                f"a message of {len(z.low)} axes says nothing about states of {len(x)}; use "
                "states x, y, θ"
            )
        return tree_of(z).log_density(x[: len(z.low)])

    def readings(self, z: Message) -> float:
        """One, as far as it is news."""
        return z.novelty

    def beams(self, z: Message) -> int:
        """One."""
        return 1

    def source(self, z: Message) -> str:
        """Who told it."""
        return z.source

    def explained(self, x: States, z: Message) -> NDArray[np.float64]:
        """(n,): 1 where the detection is more likely true than false, else 0; NaN where z says
        nothing.
        """
        if not z.useful:
            return np.full(x.shape[1], np.nan)
        true = self.log_told(x, z) + math.log1p(-z.p_false)
        false = math.log(z.p_false * z.even) if z.p_false > 0.0 else -math.inf
        return np.where(true > false, 1.0, 0.0)


@lru_cache(maxsize=4)
def tree_of(z: Message) -> DensityTree:
    """The density that a message tells, ready to be asked by several threads."""
    space = SE2 if len(z.low) == 3 else PLANE
    nodes = z.axis, z.split, z.child, z.corner, z.width, z.weight
    tree = DensityTree(space, z.floor, z.low, z.side, *nodes)
    tree.log_values  # noqa: B018
    return tree


def message_of(
    t: float, tree: DensityTree, source: str, *, p_false: float = 0.0, even: float = 1.0
) -> Message:
    """What is told at t by a tree; the others as of Message."""
    nodes = tree.axis, tree.split, tree.child, tree.corner, tree.width, tree.weight
    return Message(t, tree.low, tree.side, *nodes, tree.floor, p_false, even, source)


def silence(t: float, source: str) -> Message:
    """A message that says nothing: a filter that steps by it takes in no more than the move."""
    return message_of(t, NOWHERE, source, p_false=1.0)
