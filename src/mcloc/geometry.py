"""SE(2): poses (x, y, θ), metres and radians, θ in (−π, π].

Every function takes arrays whose last axis is (x, y, θ) and broadcasts over the others.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Pose = NDArray[np.float64]
"""Shape (3,): x, y in metres, θ in radians."""

Poses = NDArray[np.float64]
"""Shape (..., 3)."""


def wrap(angle: ArrayLike) -> NDArray[np.float64]:
    """The same angle in (−π, π]."""
    a = np.asarray(angle, dtype=np.float64)
    wrapped = np.pi - np.mod(np.pi - a, 2.0 * np.pi)
    return np.where(wrapped <= -np.pi, np.pi, wrapped)  # a hair above π rounds to −π


def compose(a: ArrayLike, b: ArrayLike) -> Poses:
    """a ⊕ b: the pose b, given in the frame of a, in the frame that a is given in."""
    p, q = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    cos, sin = np.cos(p[..., 2]), np.sin(p[..., 2])
    return np.stack(
        [
            p[..., 0] + cos * q[..., 0] - sin * q[..., 1],
            p[..., 1] + sin * q[..., 0] + cos * q[..., 1],
            wrap(p[..., 2] + q[..., 2]),
        ],
        axis=-1,
    )


def inverse(a: ArrayLike) -> Poses:
    """⊖a: compose(a, inverse(a)) is the identity."""
    p = np.asarray(a, dtype=np.float64)
    cos, sin = np.cos(p[..., 2]), np.sin(p[..., 2])
    return np.stack(
        [
            -cos * p[..., 0] - sin * p[..., 1],
            sin * p[..., 0] - cos * p[..., 1],
            wrap(-p[..., 2]),
        ],
        axis=-1,
    )


def between(a: ArrayLike, b: ArrayLike) -> Poses:
    """⊖a ⊕ b: the pose b in the frame of a, that is the motion from a to b."""
    return compose(inverse(a), b)


def interpolate(a: ArrayLike, b: ArrayLike, fraction: ArrayLike) -> Poses:
    """The pose at `fraction` of the way from a to b: linear in position, the short way in θ."""
    p, q = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    f = np.asarray(fraction, dtype=np.float64)[..., None]
    step = q - p
    step[..., 2] = wrap(step[..., 2])
    result = p + f * step
    result[..., 2] = wrap(result[..., 2])
    return result


def transported(a: ArrayLike, covariance: ArrayLike, u: ArrayLike) -> NDArray[np.float64]:
    """(3, 3): the covariance of a ⊕ u for a known u, to first order: J Σ Jᵀ, J = ∂(a ⊕ u)/∂a."""
    moved = compose(a, u) - np.asarray(a, dtype=np.float64)
    jacobian = np.array([[1.0, 0.0, -moved[1]], [0.0, 1.0, moved[0]], [0.0, 0.0, 1.0]])
    sigma = np.asarray(covariance, dtype=np.float64)
    carried: NDArray[np.float64] = np.einsum("ij,jk,lk->il", jacobian, sigma, jacobian)
    return carried
