"""Converged: error < 0.5 m and < 10° from some moment on, for at least 3 m and 5 references.

References err, too: where those of a log jump for a moment, a robot that is localized all the time
has converged only after the last of such moments. `found` asks for 3 m and 5 references in a row.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.evaluation.errors import STAMP_TOLERANCE, PoseErrors
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
    return [
        _recovery(errors, *stretch, _converged(errors, *stretch))
        for stretch in _stretches(errors, kidnappings)
    ]


def found(errors: PoseErrors, kidnappings: list[Kidnapping]) -> list[Recovery]:
    """The same, but from the first moment on after which errors stay small for 3 m and 5
    references, whatever comes later.
    """
    return [
        _recovery(errors, *stretch, _found(errors, *stretch))
        for stretch in _stretches(errors, kidnappings)
    ]


def localized_fraction(errors: PoseErrors, last: Recovery) -> float | None:
    """The share of the time with small errors, from the moment on at which the robot was `found` in
    the last stretch; None where it was not.
    """
    if last.after_s is None:
        return None
    since = int(np.searchsorted(errors.t, last.t + last.after_s - STAMP_TOLERANCE))
    after = np.arange(len(errors.t)) >= since
    small = after.copy()
    small[_bad(errors, since, len(errors.t))] = False
    return errors.time_fraction(small) / errors.time_fraction(after)


def _stretches(
    errors: PoseErrors, kidnappings: list[Kidnapping]
) -> Iterator[tuple[Kidnapping, int]]:
    """The start of the run and each kidnapping, and where the next one is."""
    starts = [Kidnapping(float(errors.t[0]), 0), *kidnappings]
    ends = [kidnapping.first for kidnapping in kidnappings] + [len(errors.t)]
    return zip(starts, ends, strict=True)


def _bad(errors: PoseErrors, first: int, end: int) -> NDArray[np.intp]:
    """The references from `first` on, before `end`, at which errors are not small."""
    stretch = slice(first, end)
    bad = (errors.position[stretch] >= CONVERGED_DISTANCE) | (
        errors.heading[stretch] >= CONVERGED_ANGLE
    )
    return first + np.flatnonzero(bad)


def _converged(errors: PoseErrors, start: Kidnapping, end: int) -> int | None:
    """From which reference on errors stay small until the end."""
    since = int(np.max(_bad(errors, start.first, end), initial=start.first - 1)) + 1
    return since if _long_enough(errors, since, end) else None


def _found(errors: PoseErrors, start: Kidnapping, end: int) -> int | None:
    """From which reference on errors stay small for long enough."""
    since = start.first
    for bad in (*_bad(errors, start.first, end).tolist(), end):
        if _long_enough(errors, since, bad):
            return since
        since = bad + 1
    return None


def _long_enough(errors: PoseErrors, since: int, end: int) -> bool:
    if end - since < CONVERGED_REFERENCES:
        return False
    # The tolerance is for the rounding of a path that is a sum of many steps.
    return bool(errors.travelled[end - 1] - errors.travelled[since] >= CONVERGED_PATH - 1e-6)


def _recovery(errors: PoseErrors, start: Kidnapping, end: int, since: int | None) -> Recovery:
    path = errors.travelled
    # Between two kidnappings there may be no reference at all.
    path_m = float(path[end - 1] - path[start.first]) if end > start.first else 0.0
    if since is None:
        return Recovery(start.t, recovered=False, path_m=path_m)
    return Recovery(
        start.t,
        recovered=True,
        path_m=path_m,
        after_s=max(0.0, float(errors.t[since]) - start.t),
        after_m=float(path[since] - path[start.first]),
    )
