"""p(z | x) of a patch of the ceiling, by normalized correlation with the mosaic.

v: the brightness of the patch at P points, less its mean, scaled to length 1: a direction, which
neither gain nor offset of the camera change. d(x): the same of the mosaic, when the robot is at x.

    p(v | x) = (1 − ε) C(κ) exp(κ ρ) + ε / A,  ρ = v · d,

a von Mises-Fisher density on the sphere of such directions, in P − 1 dimensions, whose area is A
[Mardia, Jupp: Directional statistics, §9.3.2]; ρ is the normalized correlation. Noise of deviation
σ at each point turns the direction of a patch with contrast s, the length of d before it is scaled,
by about σ / s: 1/κ = (σ_noise / s)² + mismatch². So where the mosaic is flat κ = 0, and p uniform.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, ive

from mcloc.events import Image
from mcloc.registry import param
from mcloc.sensors.ceiling import NOTHING, CeilingModel
from mcloc.sensors.ceiling_view import Reals
from mcloc.statespace import LogWeights, States

KNOTS = 1024
ALIKE = 0.5  # normalized correlation from which on the mosaic explains a patch


@dataclass(frozen=True)
class CeilingPatch(CeilingModel):
    """A square patch of the ceiling, at across × across points that turn with the robot.

    Its points are not independent: neighbours see the same lamp, and err by the same light. So the
    log-likelihood is tempered, as if the patch had `effective_points` of them. Points where the
    mosaic is unknown count as neither bright nor dark; where all are, all patches are as likely.
    Images that are dark or flat say nothing: somebody covers the lens. ConfigError for images that
    do not hold the patch.
    """

    side: float = param(1.0, "m", "of the patch, between its outermost points", above=0, high=100)
    across: int = param(5, "", "points along a side", low=2, high=11)
    sigma_noise: float = param(
        0.05, "", "deviation of brightness at a point, white being 1", above=0, high=1
    )
    mismatch: float = param(
        0.15, "", "turn of the direction for which noise is not to blame", above=0.01, high=1
    )
    effective_points: float = param(
        2.0, "", "independent points that a patch is worth", above=0, high=1e3
    )
    flat: float = param(
        0.02, "", "deviation of brightness within a patch below which it is flat", above=0, high=1
    )

    @cached_property
    def points(self) -> Reals:
        """(2, P): metres, robot frame."""
        along = np.linspace(-0.5 * self.side, 0.5 * self.side, self.across)
        return np.stack([np.repeat(along, self.across), np.tile(along, self.across)])

    @property
    def count(self) -> int:
        """P."""
        return self.across**2

    def pattern(self, z: Image) -> tuple[Reals, float]:
        """v (P,), and the contrast of the patch; nothing but 0 for one that says nothing."""
        told = self.within(z, self.points)
        off = told - told.mean()
        contrast = float(np.sqrt(off @ off))
        if not (told.mean() > self.dark and contrast > self.flat * math.sqrt(self.count)):
            return np.zeros(self.count), 0.0
        return off / contrast, contrast

    def concentration(self, square: Reals | float) -> Reals:
        """κ for a contrast whose square is given."""
        square = np.asarray(square, dtype=np.float64)
        kappa: Reals = square / (self.sigma_noise**2 + self.mismatch**2 * square)
        return kappa

    def log_ratio(self, kappa: Reals, rho: Reals) -> Reals:
        """log(p(v | x) A) by κ and ρ. p A is 1 in the mean over the sphere."""
        log_c = np.interp(kappa, *self._log_c)
        mixed: Reals = np.logaddexp(
            math.log1p(-self.p_outlier) + log_c + kappa * rho if self.p_outlier < 1.0 else -np.inf,
            math.log(self.p_outlier),
        )
        return mixed

    def log_likelihood(self, x: States, z: Image) -> LogWeights:
        """(n,): log p(z | x), tempered, relative to the p of a ceiling that is just as the patch
        shows it: about 0 where it is. 0 for an image that says nothing.
        """
        v, contrast = self.pattern(z)
        if contrast == 0.0:
            return np.zeros(x.shape[1])
        kappa, rho = self._compared(x, v)
        best = self.log_ratio(self.concentration(contrast**2), np.ones(1))
        log_p: LogWeights = (self.log_ratio(kappa, rho) - best) * (
            self.effective_points * z.novelty / self.count
        )
        return log_p

    def covered(self, z: Image) -> bool:
        """Whether the patch is dark, flat, or no number somewhere."""
        return self.pattern(z)[1] == 0.0

    def readings(self, z: Image) -> float:
        """effective_points × novelty; next to nothing for an image that says nothing."""
        return NOTHING if self.covered(z) else self.effective_points * z.novelty

    def beams(self, z: Image) -> int:
        """P."""
        return self.count

    def explained(self, x: States, z: Image) -> NDArray[np.float64]:
        """(n,): 1 where the normalized correlation is ½ or more, else 0; NaN for an image that says
        nothing.
        """
        v, contrast = self.pattern(z)
        if contrast == 0.0:
            return np.full(x.shape[1], np.nan)
        return (self._compared(x, v)[1] >= ALIKE).astype(np.float64)

    def _compared(self, x: States, v: Reals) -> tuple[Reals, Reals]:
        """(n,) each: κ, and ρ, which is 0 where the mosaic is flat."""
        dots, squares = self.expected.match(x, self.points, v)
        rho = np.divide(dots, np.sqrt(squares), out=np.zeros_like(dots), where=squares > 0.0)
        return self.concentration(squares), np.clip(rho, -1.0, 1.0)

    @cached_property
    def _log_c(self) -> tuple[Reals, Reals]:
        """log(C(κ) A) at knots of κ, from 0 to the largest: 0 at 0."""
        order = 0.5 * (self.count - 1) - 1.0
        kappa = np.linspace(0.0, self.mismatch**-2, KNOTS)
        k = kappa[1:]
        # Γ(m) (κ/2)^(1−m) I_{m−1}(κ) is the mean of exp(κ ρ) over the sphere, m half its dimensions
        mean = gammaln(order + 1.0) - order * np.log(0.5 * k) + np.log(ive(order, k)) + k
        return kappa, np.concatenate([[0.0], -mean])
