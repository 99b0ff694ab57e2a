"""Converged: error < 0.5 m and < 10° from some moment on, for at least 3 m and 5 references."""

from dataclasses import dataclass

import numpy as np

from mcloc.evaluation.errors import PoseErrors
from mcloc.evaluation.kidnapping import Kidnapping

CONVERGED_DISTANCE = 0.5  # m
CONVERGED_ANGLE = np.radians(10.0)
CONVERGED_PATH = 3.0  # m of true path
CONVERGED_REFERENCES = 5


@dataclass(frozen=True)
class Recovery:
    """Whether, and how soon after t, a stretch of the run is localized until it ends.

    t: the kidnapping or the start of the run, seconds. path_m: metres of true path from the first
    reference after t to the last of the stretch. after_s: seconds from t, and after_m: metres of
    true path from the first reference after t, to the moment from which the errors stay small; both
    None where they do not.
    """

    t: float
    recovered: bool
    path_m: float
    after_s: float | None = None
    after_m: float | None = None


def recoveries(errors: PoseErrors, kidnappings: list[Kidnapping]) -> list[Recovery]:
    """One for the start of the run, then one for each kidnapping, each up to the next one."""
    starts = [Kidnapping(float(errors.t[0]), 0), *kidnappings]
    ends = [kidnapping.first for kidnapping in kidnappings] + [len(errors.t)]
    return [_recovery(errors, start, end) for start, end in zip(starts, ends, strict=True)]


def _recovery(errors: PoseErrors, start: Kidnapping, end: int) -> Recovery:
    stretch = slice(start.first, end)
    bad = (errors.position[stretch] >= CONVERGED_DISTANCE) | (
        errors.heading[stretch] >= CONVERGED_ANGLE
    )
    path = errors.travelled
    # Between two kidnappings there may be no reference at all.
    path_m = float(path[end - 1] - path[start.first]) if end > start.first else 0.0
    since = start.first + int(np.max(np.flatnonzero(bad), initial=-1)) + 1
    if end - since < CONVERGED_REFERENCES:
        return Recovery(start.t, recovered=False, path_m=path_m)
    # The tolerance is for the rounding of a path that is a sum of many steps.
    if path[end - 1] - path[since] < CONVERGED_PATH - 1e-6:
        return Recovery(start.t, recovered=False, path_m=path_m)
    return Recovery(
        start.t,
        recovered=True,
        path_m=path_m,
        after_s=max(0.0, float(errors.t[since]) - start.t),
        after_m=float(path[since] - path[start.first]),
    )
