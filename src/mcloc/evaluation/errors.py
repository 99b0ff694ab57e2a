"""e(t) = x̂(t) − x(t) at each reference stamp t, in the map frame, without alignment."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import TruthError
from mcloc.geometry import Poses, between, interpolate, wrap
from mcloc.trajectory import Trajectory

STAMP_TOLERANCE = 1e-3  # s: logs and references print the same stamp with different digits
JUMP_DISTANCE = 1.0  # m
JUMP_ANGLE = np.radians(45.0)
GAP_CAP = 5.0  # s: a reference speaks of no more time than this


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """The estimate against the N references that it covers, in order of time.

    t: (N,) seconds. reference: (N, 3) the truth. difference: (N, 3) estimate minus truth, metres
    and radians, θ in (−π, π]. covariances: (N, 3, 3) and share: (N,) of the estimate, or None.
    """

    t: NDArray[np.float64]
    reference: Poses
    difference: NDArray[np.float64]
    covariances: NDArray[np.float64] | None
    share: NDArray[np.float64] | None

    @cached_property
    def position(self) -> NDArray[np.float64]:
        """(N,) metres."""
        return np.hypot(self.difference[:, 0], self.difference[:, 1])

    @cached_property
    def heading(self) -> NDArray[np.float64]:
        """(N,) radians, 0 … π."""
        return np.abs(self.difference[:, 2])

    @cached_property
    def travelled(self) -> NDArray[np.float64]:
        """(N,) metres: length of the true path from the first reference."""
        step = np.diff(self.reference[:, :2], axis=0)
        return np.append(0.0, np.cumsum(np.hypot(step[:, 0], step[:, 1])))

    def lost_fraction(self, limit: float) -> float:
        """The share of time with a position error above `limit` metres."""
        return self.time_fraction(self.position > limit)

    def time_fraction(self, which: NDArray[np.bool_]) -> float:
        """The share of time that the references of (N,) `which` carry.

        A reference carries the time to the next one, at most 5 s; the last one carries none,
        unless it is the only one.
        """
        carried = np.append(np.minimum(np.diff(self.t), GAP_CAP), 0.0)
        weights = carried if len(carried) > 1 else np.ones(1)
        return float(np.sum(weights[which]) / np.sum(weights))


def pose_errors(estimate: Trajectory, reference: Trajectory) -> PoseErrors:
    """The errors at each reference stamp from the first to the last estimate.

    A reference within 1 ms of an estimate is compared with that estimate. Elsewhere the estimate is
    interpolated between its neighbours, unless they are a jump apart (> 1 m or > 45° from the
    motion of the truth between them): no filter ever claimed the places between two
    hypotheses, so the earlier estimate stands until the later one is made.

    Raises TruthError if either is empty or not finite, or no reference lies within the estimate.
    """
    for name, trajectory in (("estimate", estimate), ("reference", reference)):
        if len(trajectory) == 0:
            raise TruthError(f"the {name} holds no poses: nothing can be evaluated")
        if not (np.isfinite(trajectory.t).all() and np.isfinite(trajectory.poses).all()):
            raise TruthError(f"the {name} holds stamps or poses that are not finite: remove them")
    covered = (reference.t >= estimate.t[0] - STAMP_TOLERANCE) & (
        reference.t <= estimate.t[-1] + STAMP_TOLERANCE
    )
    if not covered.any():
        raise TruthError(
            f"no reference lies within the estimate: {_span(estimate)} (estimate), "
            f"{_span(reference)} (reference); both must carry the stamps of the same log"
        )
    t, truth = reference.t[covered], reference.poses[covered]
    before, after, fraction = _neighbours(estimate, reference, t)
    difference = interpolate(estimate.poses[before], estimate.poses[after], fraction) - truth
    difference[:, 2] = wrap(difference[:, 2])

    def blend(values: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
        if values is None:
            return None
        f = fraction.reshape(-1, *[1] * (values.ndim - 1))
        blended: NDArray[np.float64] = (1.0 - f) * values[before] + f * values[after]
        return blended

    return PoseErrors(t, truth, difference, blend(estimate.covariances), blend(estimate.share))


def with_withheld(
    errors: PoseErrors, reference: Trajectory, scans: tuple[float, float]
) -> PoseErrors:
    """The same with the references before and after them from the first to the last scan, for which
    no pose was told: there the estimate is infinitely far off, and has no covariance and share.

    scans: stamps of the first and the last scan, not after the first and before the last estimate.
    """
    first, last = scans
    heard = (reference.t >= first - STAMP_TOLERANCE) & (reference.t <= last + STAMP_TOLERANCE)
    t, truth = reference.t[heard], reference.poses[heard]
    if len(t) == len(errors.t):
        return errors
    difference = np.full(truth.shape, np.inf)
    difference[np.isin(t, errors.t)] = errors.difference
    return PoseErrors(t, truth, difference, None, None)


def _neighbours(
    estimate: Trajectory, reference: Trajectory, t: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Indices of the estimates to either side of each stamp, and the way between them to go."""
    after = np.minimum(np.searchsorted(estimate.t, t), len(estimate) - 1)
    before = np.maximum(after - 1, 0)
    from_before, to_after = t - estimate.t[before], estimate.t[after] - t
    nearest = np.where(np.abs(to_after) < np.abs(from_before), after, before)
    coincident = np.abs(t - estimate.t[nearest]) <= STAMP_TOLERANCE

    believed = between(estimate.poses[before], estimate.poses[after])
    true = between(reference.at(estimate.t[before]), reference.at(estimate.t[after]))
    residual = between(true, believed)
    jumped = (np.hypot(residual[:, 0], residual[:, 1]) > JUMP_DISTANCE) | (
        np.abs(residual[:, 2]) > JUMP_ANGLE
    )

    before = np.where(coincident, nearest, before)
    after = np.where(coincident | jumped, before, after)
    span = estimate.t[after] - estimate.t[before]
    fraction = np.divide(t - estimate.t[before], span, out=np.zeros(len(t)), where=span > 0)
    return before, after, fraction


def _span(trajectory: Trajectory) -> str:
    return f"t = {trajectory.t[0]:.3f} … {trajectory.t[-1]:.3f} s"
