"""A kidnapping: a jump of the truth that odometry does not explain.

Between successive references, with u the motion that the wheels report and v the true one,
‖v_xy‖ and ‖(⊖u ⊕ v)_xy‖ both > 1 m, or |v_θ| and |(⊖u ⊕ v)_θ| both > 45°.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcloc.evaluation.errors import JUMP_ANGLE, JUMP_DISTANCE, STAMP_TOLERANCE
from mcloc.geometry import Poses, between
from mcloc.trajectory import Trajectory

# Wheels drift, so over a gap in the references a residual must also exceed what drift can explain.
# The worst wheels at hand (Intel Research Lab) turn up to 5° too far a metre over 10 m. Up to 3.7 m
# of straight driving between references this stays below the limits above.
SCALE_DRIFT = 0.1  # of the distance driven, and of the angle turned
HEADING_DRIFT = np.radians(5.0)  # a metre driven


@dataclass(frozen=True)
class Kidnapping:
    """t: seconds. first: index of the first reference after it."""

    t: float
    first: int


def find_kidnappings(
    t: NDArray[np.float64],
    truth: Poses,
    odometry: Trajectory | None,
    listed: Sequence[float] = (),
) -> list[Kidnapping]:
    """The kidnappings of a true path in order of time: those listed, and those that odometry shows.

    t: (N,) seconds. truth: (N, 3) references. Without odometry none is detected. One listed for
    time k lies just before the first reference with a stamp ≥ k; outside the references it is left
    out. One detected gets the stamp of the first reference after the jump, and is dropped
    where a listed one lies between the same two references.
    """
    jumps = [] if odometry is None or len(odometry) == 0 else _jumps(t, truth, odometry)
    found = [
        Kidnapping(float(t[i]), i)
        for i in jumps
        if not any(t[i - 1] - STAMP_TOLERANCE <= k <= t[i] + STAMP_TOLERANCE for k in listed)
    ]
    for k in listed:
        if t[0] - STAMP_TOLERANCE <= k <= t[-1] + STAMP_TOLERANCE:
            first = int(np.searchsorted(t, k - STAMP_TOLERANCE))
            # A reference at the very moment may still be in the old place.
            if first + 1 in jumps and t[first] <= k + STAMP_TOLERANCE:
                first += 1
            found.append(Kidnapping(float(k), first))
    return sorted(found, key=lambda kidnapping: (kidnapping.first, kidnapping.t))


def _jumps(t: NDArray[np.float64], truth: Poses, odometry: Trajectory) -> list[int]:
    """Indices of the first reference after each jump; where odometry is missing, none is seen."""
    wheels = odometry.at(t)
    motion = between(truth[:-1], truth[1:])
    residual = between(between(wheels[:-1], wheels[1:]), motion)

    step = np.abs(between(odometry.poses[:-1], odometry.poses[1:]))
    driven = _between_stamps(t, odometry.t, np.hypot(step[:, 0], step[:, 1]))
    turned = _between_stamps(t, odometry.t, step[:, 2])
    angle_drift = SCALE_DRIFT * turned + HEADING_DRIFT * driven
    # A heading that drifts steadily is off by half its final error on average.
    drift = driven * (SCALE_DRIFT + SCALE_DRIFT * turned + HEADING_DRIFT * driven / 2.0)

    distance_jump = (_distance(motion) > JUMP_DISTANCE) & (
        _distance(residual) > np.maximum(JUMP_DISTANCE, drift)
    )
    angle_jump = (np.abs(motion[:, 2]) > JUMP_ANGLE) & (
        np.abs(residual[:, 2]) > np.maximum(JUMP_ANGLE, angle_drift)
    )
    known = (t[:-1] >= odometry.t[0] - STAMP_TOLERANCE) & (
        t[1:] <= odometry.t[-1] + STAMP_TOLERANCE
    )
    return [int(i) + 1 for i in np.flatnonzero(known & (distance_jump | angle_jump))]


def _distance(motion: Poses) -> NDArray[np.float64]:
    distance: NDArray[np.float64] = np.hypot(motion[:, 0], motion[:, 1])
    return distance


def _between_stamps(
    t: NDArray[np.float64], stamps: NDArray[np.float64], steps: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(len(t) − 1,): the sum of the steps taken from each t to the next."""
    total = np.append(0.0, np.cumsum(steps))
    return np.diff(np.interp(t, stamps, total))
