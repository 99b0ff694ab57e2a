"""The accuracy of a run: what `summary.json` says about the estimate against a reference."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcloc.evaluation.consistency import nees_median
from mcloc.evaluation.convergence import Recovery, found, localized_fraction, recoveries
from mcloc.evaluation.errors import pose_errors, with_withheld
from mcloc.evaluation.kidnapping import find_kidnappings
from mcloc.trajectory import Trajectory

LOST_LIMITS = ("0.5", "1", "2")  # m
SIGHTED = 5.0  # s before or after a sighting of a landmark


@dataclass(frozen=True)
class Accuracy:
    """Errors in the map frame without alignment, over the references that the estimate covers.

    lost_fraction: the share of time with a position error above 0.5, 1 and 2 m. converged,
    time_to_converge_s and distance_to_converge_m speak of the stretch after the last kidnapping, or
    of the whole run, from its first scan on; so do time_to_find_s and distance_to_find_m, of the
    moment after which errors stay small for 3 m and 5 references, and localized_fraction, of the
    time since then: the share with small errors. recoveries: one for each kidnapping. sighted: how
    many references are within 5 s of a sighting of a landmark, and position_median_sighted_m, their
    error. None where unknown.
    """

    position_median_m: float
    position_rmse_m: float
    position_p95_m: float
    position_max_m: float
    heading_median_deg: float
    heading_rmse_deg: float
    heading_p95_deg: float
    lost_fraction: dict[str, float]
    converged: bool
    time_to_converge_s: float | None
    distance_to_converge_m: float | None
    time_to_find_s: float | None
    distance_to_find_m: float | None
    localized_fraction: float | None
    nees_median: float | None
    recoveries: tuple[Recovery, ...]
    sighted: int = 0
    position_median_sighted_m: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """The `accuracy` of summary.json, which leaves out the heading's RMSE and p95; and what is
        about sightings, where there were none.
        """
        values = asdict(self)
        del values["heading_rmse_deg"], values["heading_p95_deg"]
        if self.sighted == 0:
            del values["sighted"], values["position_median_sighted_m"]
        values["recoveries"] = list(values["recoveries"])
        return values


def evaluate(
    estimate: Trajectory,
    reference: Trajectory,
    *,
    odometry: Trajectory | None = None,
    kidnappings: Sequence[float] = (),
    scans: tuple[float, float] | None = None,
    sightings: NDArray[np.float64] | None = None,
) -> Accuracy:
    """Compare an estimate with the truth, both in the map frame.

    odometry: the wheels' poses in their own frame; with it kidnappings are detected. kidnappings:
    stamps of those that were injected, seconds. scans: stamps of the first and the last scan; a
    filter that told no pose at the first ones or the last ones was not localized there; None: it
    told one at all of them. sightings: (S,) stamps of those of landmarks, in order. Definitions:
    `errors`, `kidnapping`, `convergence`, `consistency`.

    Raises TruthError if no reference stamp lies within the estimate.
    """
    errors = pose_errors(estimate, reference)
    position, heading = errors.position, np.degrees(errors.heading)
    whole = errors if scans is None else with_withheld(errors, reference, scans)
    moved = find_kidnappings(whole.t, whole.reference, odometry, kidnappings)
    stretches = recoveries(whole, moved)
    last, first = stretches[-1], found(whole, moved)[-1]
    seen = np.zeros(len(errors.t), dtype=np.bool_)
    if sightings is not None and len(sightings):
        seen = _within(errors.t, sightings, SIGHTED)
    return Accuracy(
        position_median_m=float(np.median(position)),
        position_rmse_m=_rms(position),
        position_p95_m=float(np.percentile(position, 95.0)),
        position_max_m=float(np.max(position)),
        heading_median_deg=float(np.median(heading)),
        heading_rmse_deg=_rms(heading),
        heading_p95_deg=float(np.percentile(heading, 95.0)),
        lost_fraction={limit: errors.lost_fraction(float(limit)) for limit in LOST_LIMITS},
        converged=last.recovered,
        time_to_converge_s=last.after_s,
        distance_to_converge_m=last.after_m,
        time_to_find_s=first.after_s,
        distance_to_find_m=first.after_m,
        localized_fraction=localized_fraction(whole, first),
        nees_median=nees_median(errors),
        recoveries=tuple(stretches[1:]),
        sighted=int(seen.sum()),
        position_median_sighted_m=float(np.median(position[seen])) if seen.any() else None,
    )


def _within(t: NDArray[np.float64], stamps: NDArray[np.float64], most: float) -> NDArray[np.bool_]:
    """(N,): whether any of the stamps (S,), in order, is at most so many seconds from each t."""
    after = np.minimum(np.searchsorted(stamps, t), len(stamps) - 1)
    nearest = np.minimum(np.abs(t - stamps[after]), np.abs(t - stamps[np.maximum(after - 1, 0)]))
    close: NDArray[np.bool_] = nearest <= most
    return close


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
