"""z = argmax_x log p(z_t | x) near where the robot is expected, and J = −∂² log p / ∂x² there: the
pose that a scan-to-map match gives  [Olson: Real-time correlative scan matching, ICRA 2009; for the
shape of the peak, the quadratic that fits log p around it].
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.density import Gaussian
from mcloc.geometry import Pose, wrap
from mcloc.statespace import LogWeights, States

LATTICE = np.array([0.1, 0.1, np.deg2rad(2.0)])
"""m, m, rad between the poses that are tried first."""

MOST = 20  # of them on each side of the middle; a wider gate is searched more coarsely
STENCIL = np.array([0.05, 0.05, np.deg2rad(1.0)])
"""m, m, rad between the poses that the quadratic is fitted to: no less than a cell of usual maps,
or it fits their cells."""

REACH = 2  # of them on each side
CLIMBS = 5  # quadratics; the last one is where the answer is read from

LogLikelihood = Callable[[States], LogWeights]


@dataclass(frozen=True, eq=False, slots=True)
class Match:
    """pose: (3,) m, m, rad. information: (3, 3) positive semidefinite; 0 along what the measurement
    says nothing about. weighed: at how many poses it was looked.
    """

    pose: Pose
    information: NDArray[np.float64]
    weighed: int


def match(log_p: LogLikelihood, expected: Gaussian, gate: NDArray[np.float64]) -> Match:
    """The peak of log p that is the most likely one before it was measured.

    log_p: (3, n) -> (n,), of a measurement. gate: (3,) m, m, rad to each side of the expected mean.

    Of a lattice over the gate that pose is taken where log p + log N(x; expected) is largest. From
    there on it climbs log p alone, by the peaks of quadratics, and within the gate.
    """
    lattice = expected.mean[:, None] + _lattice(gate)
    lattice[2] = wrap(lattice[2])
    x = lattice[:, int(np.argmax(log_p(lattice) + expected.log_density(lattice)))]
    for _ in range(CLIMBS):
        information, step = _peak(log_p, x)
        moved = np.clip(_apart(x, expected.mean) + step, -gate, gate)
        x = expected.mean + moved
        x[2] = wrap(x[2])
    return Match(x, information, lattice.shape[1] + CLIMBS * len(_OFFSETS))


def _lattice(gate: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, n): steps from the middle of a gate to all poses that are tried."""
    sides = []
    for reach, spacing in zip(gate, LATTICE, strict=True):
        n = min(int(np.ceil(reach / spacing)), MOST)
        sides.append(np.linspace(-reach, reach, 2 * n + 1))
    return np.stack([axis.ravel() for axis in np.meshgrid(*sides, indexing="ij")])


def _apart(a: Pose, b: Pose) -> NDArray[np.float64]:
    """a − b, the short way in θ."""
    e: NDArray[np.float64] = a - b
    e[2] = wrap(e[2])
    return e


def _peak(log_p: LogLikelihood, x: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Information and way to the peak (3,) of the quadratic that fits log p around x best.

    Along axes where that has no peak both are 0. It is trusted no farther than it was fitted.
    """
    at = x[:, None] + (STENCIL * _OFFSETS).T
    at[2] = wrap(at[2])
    values = log_p(at)
    floor = values[np.isfinite(values)].min(initial=0.0)
    fitted = _FIT @ np.maximum(values, floor)
    curved, axes = np.linalg.eigh(-_symmetric(fitted[3:]))
    informative = curved > 1e-9 * max(float(np.abs(curved).max()), 1e-300)
    curved = np.where(informative, curved, 0.0)
    slope = axes.T @ fitted[:3]
    ways = np.divide(slope, curved, out=np.zeros(3), where=informative)
    step = axes @ np.clip(ways, -REACH, REACH)
    information = (axes * curved) @ axes.T / np.outer(STENCIL, STENCIL)
    return information, STENCIL * step


def _symmetric(upper: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3): second derivatives from xx, xy, xθ, yy, yθ, θθ."""
    full = np.empty((3, 3))
    full[_UPPER] = upper
    full.T[_UPPER] = upper
    return full


_UPPER = np.triu_indices(3)
_OFFSETS = np.array(list(itertools.product(range(-REACH, REACH + 1), repeat=3)), dtype=np.float64)
"""(n, 3): the stencil, in its own spacing."""


def _fit() -> NDArray[np.float64]:
    """(9, n): first and second derivatives, by least squares, from values on the stencil."""
    first = _OFFSETS
    second = np.stack(
        [
            _OFFSETS[:, a] * _OFFSETS[:, b] * (0.5 if a == b else 1.0)
            for a, b in zip(*_UPPER, strict=True)
        ],
        axis=1,
    )
    terms = np.concatenate([np.ones((len(first), 1)), first, second], axis=1)
    solved: NDArray[np.float64] = np.linalg.pinv(terms)[1:]
    return solved


_FIT = _fit()
