"""NEES, the normalized estimation error squared: eᵀ P⁻¹ e, with e = (x, y, θ), θ circular."""

import numpy as np

from mcloc.evaluation.errors import PoseErrors

SINGLE_HYPOTHESIS = 0.95  # the share from which one Gaussian speaks for the whole belief


def nees_median(errors: PoseErrors) -> float | None:
    """The median NEES where one hypothesis holds more than 95 % of the belief.

    An honest filter has the median of χ² with 3 degrees of freedom, 2.366: more is overconfidence,
    less is underconfidence. The reference counts as exact: its own error, where it
    is not small against P, adds to the NEES. None where shares or covariances are not given, or no
    reference has a share > 0.95 and a positive definite covariance.
    """
    if errors.covariances is None or errors.share is None:
        return None
    usable = (errors.share > SINGLE_HYPOTHESIS) & np.isfinite(errors.covariances).all(axis=(1, 2))
    e, covariances = errors.difference[usable], errors.covariances[usable]
    spread = np.linalg.eigvalsh(covariances)
    invertible = spread[:, 0] > 1e-12 * spread[:, 2]
    e, covariances = e[invertible], covariances[invertible]
    if len(e) == 0:
        return None
    scaled = np.linalg.solve(covariances, e[..., None])[..., 0]
    return float(np.median(np.sum(e * scaled, axis=1)))
