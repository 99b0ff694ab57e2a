"""p(x_t | u_t, x_{t−1}) on tiles: an action succeeds with 1/2, and what can happen instead shares
the rest  [Est §2.1].
"""

from dataclasses import dataclass
from functools import cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws, Stream
from mcloc.environment import Tiles
from mcloc.errors import FilterError
from mcloc.statespace import LogWeights, States

ACTIONS = (-1, 0, 1)  # L, S, R: one tile less, stay, one tile more

Actions = NDArray[np.int64]
"""(D,): one of ACTIONS for each axis."""

Chances = NDArray[np.float64]
"""(length, length): the chance of each tile of a row given another one, which is the matrix's row;
0 for tiles that are no neighbours.
"""


@cache
def transition(action: int, length: int) -> Chances:
    """(length, length): p(x_t | action, x_{t−1}) on a row of tiles 0 … length − 1, x_{t−1} by row.

    The tile that is meant has 1/2; the others of x_{t−1} − 1, x_{t−1} and x_{t−1} + 1 that are on
    the row share the rest equally. An action that leads off the row means staying: the paper says
    that a robot on the first tile cannot move left, and gives no chances for it. On a row of one
    tile it stays. Raises FilterError for an action that is none.
    """
    if action not in ACTIONS:
        raise FilterError(f"an action on tiles must be -1, 0 or 1 on each axis, got {action}")
    x = np.arange(length)
    meant = np.clip(x + int(action), 0, length - 1)
    fails = np.abs(x - x[:, None]) <= 1
    fails[x, meant] = False
    p: Chances = 0.5 * fails / np.maximum(fails.sum(axis=1, keepdims=True), 1)
    p[x, meant] = 1.0 - p.sum(axis=1)
    p.flags.writeable = False
    return p


@dataclass(frozen=True)
class TileMotion:
    """Motion model of a robot that steps from tile to tile, along each axis on its own.

    x: (D, n) tiles, whole numbers 0 … shape[k] − 1 on axis k; D ≤ 4. u: (D,) an action for each
    axis. Nothing is moved that does not stand on a tile: this is left to the caller. Densities are
    chances, and 0 where a state is no tile. Raises ConfigError for a shape that cannot be.
    """

    shape: tuple[int, ...]

    def __post_init__(self) -> None:
        Tiles(self.shape)

    def sample(self, x: States, u: Actions, draws: Draws, first: int) -> States:
        """(D, n): x_t ~ p(x_t | u, x) for each column of x."""
        return _stepped(self._transitions(u), x, draws, first)

    def sample_previous(self, x_new: States, u: Actions, draws: Draws, first: int) -> States:
        """(D, n): x_{t−1} ~ p(x_new | u, x_{t−1}) / π(x_new | u)."""
        back = [(p / p.sum(axis=0)).T for p in self._transitions(u)]
        return _stepped(back, x_new, draws, first)

    def log_density(self, x_new: States, u: Actions, x: States) -> LogWeights:
        """(n,): log p(x_new | u, x)."""
        pairs = zip(self._transitions(u), x, x_new, strict=True)
        return _log_product([Tiles(p.shape).at(p, np.stack([i, j])) for p, i, j in pairs])

    def log_pi(self, x_new: States, u: Actions) -> LogWeights:
        """(n,): log π(x_new | u) = log Σ p(x_new | u, x_{t−1}): 0 but near the ends of a row."""
        into = [p.sum(axis=0) for p in self._transitions(u)]
        return _log_product(
            [Tiles(pi.shape).at(pi, j[None]) for pi, j in zip(into, x_new, strict=True)]
        )

    def doubted(self) -> Self:
        """Itself: that actions fail is part of the model."""
        return self

    def _transitions(self, u: Actions) -> list[Chances]:
        return [transition(a, length) for a, length in zip(u, self.shape, strict=True)]


def _stepped(chances: list[Chances], x: States, draws: Draws, first: int) -> States:
    """(D, n): for each x the same tile or a neighbour, by the chances in its row."""
    uniform = draws.uniform(Stream.MOTION, first, x.shape[1])[: len(x)]
    stepped = np.empty_like(x)
    for k, p in enumerate(chances):
        less = np.append(0.0, p.diagonal(-1))
        no_more = less + p.diagonal()
        i = x[k].astype(np.intp)
        stepped[k] = x[k] - 1.0 + (uniform[k] > less[i]) + (uniform[k] > no_more[i])
    return stepped


def _log_product(each: list[Chances]) -> LogWeights:
    """(n,): of independent axes, (n,) each."""
    with np.errstate(divide="ignore"):
        log_p: LogWeights = np.log(np.prod(each, axis=0))
    return log_p
