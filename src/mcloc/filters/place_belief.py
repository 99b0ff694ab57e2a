"""What topological Markov localization believes: a mass for each state, and where within them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.estimate import LEAST_SHARE, Hypothesis
from mcloc.filters.place_states import PlaceStates
from mcloc.filters.recovery import Evidence
from mcloc.geometry import compose, wrap
from mcloc.particles import Particles, log_sum_exp
from mcloc.statespace import LogWeights, States

UNSEEN = 1e-3  # × the mass of a uniform belief: states below stand for nothing


@dataclass(frozen=True, eq=False)
class PlaceBelief:
    """What is believed of where the robot was when its states were looked up last, and what has
    happened since.

    before: (S,) mass of each state then; in all 1. moved: (3,) how far the robot drove since, m, m,
    rad, in its own frame then. log_p: (n,) of the scans since: Σ log p(z | x) p(x | m) for a robot
    that was at the nth pose that stands for a state.
    """

    states: PlaceStates
    before: NDArray[np.float64]
    moved: NDArray[np.float64]
    log_p: LogWeights
    evidence: Mapping[str, Evidence] = field(default_factory=dict)

    @cached_property
    def log_total(self) -> float:
        """log p of the scans since; −inf where nothing explains them."""
        return log_sum_exp(self._log_mass)

    @cached_property
    def mass(self) -> NDArray[np.float64]:
        """(S,): of each state, by now; in all 1."""
        mass: NDArray[np.float64] = np.exp(self._log_mass - self.log_total)
        return mass

    @cached_property
    def log_poses(self) -> LogWeights:
        """(n,): log mass of each pose that stands for a state, by now, up to log_total."""
        each = _log(self.before / self.states.sizes)
        log_poses: LogWeights = each[self.states.state] + self.log_p
        return log_poses

    @cached_property
    def held(self) -> NDArray[np.intp]:
        """The poses of the states that hold nearly all mass."""
        least = UNSEEN / len(self.mass)
        return np.flatnonzero(self.mass[self.states.state] > least)

    @cached_property
    def particles(self) -> Particles:
        """These poses, moved, each with its mass."""
        x = moved_by(self.states.poses[:, self.held], self.moved)
        return Particles.normalized(x, self.log_poses[self.held])

    @cached_property
    def _log_mass(self) -> LogWeights:
        return _log(self.before) + self.states.log_mean(self.log_p)

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """The hills of the mass over the graph, most likely first; at least one."""
        root = self.states.hills(self.mass)
        shares = np.bincount(root, self.mass, len(root))
        ranked = np.argsort(-shares, kind="stable")
        chosen = ranked[: max(int((shares >= LEAST_SHARE).sum()), 1)]
        hill_of = root[self.states.state[self.held]]
        weights, x = self.particles.weights, self.particles.states
        within = np.diag(self.states.sides**2 / 12.0)
        found = []
        for top in chosen.tolist():
            mine = hill_of == top
            mean, covariance = _moments(x[:, mine], weights[mine])
            found.append(Hypothesis(mean, covariance + within, min(float(shares[top]), 1.0)))
        return tuple(found)


def _log(mass: NDArray[np.float64]) -> LogWeights:
    """−inf for 0."""
    with np.errstate(divide="ignore"):
        log_mass: LogWeights = np.log(mass)
    return log_mass


def moved_by(x: States, u: NDArray[np.float64]) -> States:
    """(3, n): each pose x (3, n) after the move u."""
    if not u.any():
        return x
    return np.ascontiguousarray(compose(x.T, u).T)


def _moments(
    x: States, weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean (3,) and covariance (3, 3) of weighted poses, circular in θ."""
    w = weights / weights.sum()
    # Not matrix products: BLAS may add in another order with other threads.
    mean = np.einsum("an,n->a", x, w)
    sine, cosine = np.einsum("an,n->a", [np.sin(x[2]), np.cos(x[2])], w)
    mean[2] = math.atan2(sine, cosine)
    apart = x - mean[:, None]
    apart[2] = wrap(apart[2])
    covariance: NDArray[np.float64] = np.einsum("an,bn->ab", apart * w, apart)
    return mean, covariance
