"""S(d): the share of robots not yet found after d metres, S(d) = Π (1 − found / at risk), over the
distances ≤ d at which some were found  [Kaplan and Meier, JASA 53, 1958].

A robot that is carried off again, or whose log ends, before it is found has not failed: nobody
looked any longer. Up to there it counts among those at risk, and not after.
"""

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.evaluation.convergence import Recovery
from mcloc.evaluation.intervals import LEVEL, Interval, proportion

if TYPE_CHECKING:
    from scipy.stats._survival import EmpiricalDistributionFunction

LEAST_PATH = 15.0  # m: what ends sooner tells little, and mostly that it was short
ROUNDING = 1e-6  # m, of a path that is a sum of many steps


@dataclass(frozen=True, eq=False)
class Survival:
    """How far N robots drove until each was found again, where that was seen.

    path: (N,) metres driven until it was found, or else until nobody looked any longer. recovered:
    (N,) whether it was found. Raises ConfigError for no robots, for shapes that differ and for
    paths that are no distances.
    """

    path: NDArray[np.float64]
    recovered: NDArray[np.bool_]

    def __post_init__(self) -> None:
        path = np.ascontiguousarray(self.path, dtype=np.float64)
        recovered = np.ascontiguousarray(self.recovered, dtype=np.bool_)
        if path.ndim != 1 or path.shape != recovered.shape or len(path) == 0:
            raise ConfigError(
                "survival needs at least one path, and for each whether the robot was found; got "
                f"shapes {path.shape} and {recovered.shape}"
            )
        if not (np.isfinite(path) & (path >= 0.0)).all():
            raise ConfigError("paths must be finite numbers of metres >= 0")
        object.__setattr__(self, "path", path)
        object.__setattr__(self, "recovered", recovered)

    @classmethod
    def of(cls, recoveries: Iterable[Recovery], least_path: float = LEAST_PATH) -> "Survival":
        """From stretches of true path that are at least `least_path` metres long; others are left
        out.

        What was not found is censored at the end of its stretch. To be found takes some metres of
        good estimates: who was found in the last 3 m of a stretch counts as not found. Raises
        ConfigError where no stretch is long enough.
        """
        counted = [r for r in recoveries if r.path_m >= least_path - ROUNDING]
        if not counted:
            raise ConfigError(
                f"no stretch is {least_path:g} m long: drive farther, or lower least_path"
            )
        path = [r.path_m if r.after_m is None else r.after_m for r in counted]
        return cls(np.array(path), np.array([r.recovered for r in counted]))

    def __len__(self) -> int:
        return len(self.path)

    def within(self, metres: float, level: float = LEVEL) -> Interval:
        """The share 1 − S(metres) of robots that are found within so many metres.

        Its interval is the exponential Greenwood formula, log-log. That has no answer at the edges,
        where it is exact (Clopper–Pearson):

        - S = 1, nobody found yet: the upper limit is that of 0 of the robots that drove so far.
        - S = 0, the last one found: the lower limit is that of the found ones among all N, as if
          none of those out of sight had been.
        - Farther than any robot drove, S stays as it was last, and the upper limit is 1.

        Raises ConfigError for a distance < 0 or NaN.
        """
        _check_distance("a distance", metres)
        last = int(np.searchsorted(self._distances, metres, side="right")) - 1
        s = 1.0 if last < 0 else float(self._shares[last])
        drove_so_far = int(np.sum(self.path >= metres))
        if s == 1.0:
            high = proportion(0, drove_so_far, level).high if drove_so_far else 1.0
            return Interval(0.0, 0.0, high)
        if s == 0.0:
            return Interval(1.0, proportion(int(self.recovered.sum()), len(self), level).low, 1.0)
        low, high = self._limits(last, level)
        return Interval(1.0 - s, low, high if drove_so_far else 1.0)

    @cached_property
    def median(self) -> float | None:
        """Metres within which half of the robots are found: the least d with S(d) ≤ 1/2.

        None where S stays above.
        """
        half = np.flatnonzero(self._shares <= 0.5 + 1e-12)  # S is a product of rounded factors
        return float(self._distances[half[0]]) if len(half) else None

    def restricted_mean(self, limit: float) -> float:
        """The mean of min(metres until found, limit): the area under S from 0 to `limit`.

        Farther than any robot drove, S stays as it was last. Raises ConfigError unless `limit` is a
        finite distance ≥ 0.
        """
        _check_distance("the limit", limit)
        if np.isinf(limit):
            raise ConfigError("the limit of a restricted mean must be finite")
        before = self._distances < limit
        edges = np.concatenate([[0.0], self._distances[before], [limit]])
        return float(np.sum(np.diff(edges) * np.append(1.0, self._shares[before])))

    @property
    def _distances(self) -> NDArray[np.float64]:
        """(K,) those at which a robot was found or went out of sight, increasing."""
        return self._sf.quantiles

    @property
    def _shares(self) -> NDArray[np.float64]:
        """(K,) S at each of them and up to the next one."""
        return self._sf.probabilities

    def _limits(self, k: int, level: float) -> tuple[float, float]:
        """The interval of 1 − S from distance k to the next one, where 0 < S < 1."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # there are no limits at the edges
            limits: Any = self._sf.confidence_interval(level, method="log-log")
        at = self._distances[k]
        return 1.0 - float(limits.high.evaluate(at)), 1.0 - float(limits.low.evaluate(at))

    @cached_property
    def _sf(self) -> "EmpiricalDistributionFunction":
        from scipy.stats import CensoredData, ecdf  # takes half a second

        return ecdf(CensoredData.right_censored(self.path, ~self.recovered)).sf


def _check_distance(name: str, metres: float) -> None:
    if not metres >= 0.0:
        raise ConfigError(f"{name} must be a number of metres >= 0, got {metres}")
