"""A drive, localized in one way: what `mcloc run` does, on events in memory."""

from collections.abc import Callable, Iterable

from numpy.typing import ArrayLike

from mcloc.evaluation.errors import PoseErrors, pose_errors
from mcloc.events import Event
from mcloc.experiments.places import Drive
from mcloc.filters.catalog import Composition
from mcloc.localizer import Localizer, UpdatePolicy
from mcloc.localizer.localizer import INITIAL_SIGMA
from mcloc.localizer.pace import Pace
from mcloc.report.history import History

EVERY_SCAN = UpdatePolicy(distance=0.0, angle=0.0, decorrelation=1e-3)
"""Each scan is used, and counts in full: what the papers do. mcloc's own default is more careful,
since scans from nearly the same place repeat each other's errors.
"""

Before = Callable[[Localizer, Event], None]


def localized(
    drive: Drive,
    composition: Composition,
    seed: int,
    *,
    initial: ArrayLike | None = None,
    initial_sigma: ArrayLike = INITIAL_SIGMA,
    policy: UpdatePolicy | None = None,
    pace: Pace | None = None,
    events: Iterable[Event] | None = None,
    before: Before | None = None,
) -> History:
    """What was found at each scan.

    initial: (3,) start pose, None for global localization. events: those of the drive, or a part of
    them. before: called before each event, to do something to the robot.
    """
    localizer = Localizer(
        drive.grid,
        composition,
        seed=seed,
        initial=initial,
        initial_sigma=initial_sigma,
        policy=policy,
        pace=pace,
    )
    history = History()
    for event in drive.events if events is None else events:
        if before is not None:
            before(localizer, event)
        for estimate in localizer.process(event):
            history.add(estimate)
    for estimate in localizer.finish():
        history.add(estimate)
    return history


def errors_of(drive: Drive, history: History) -> PoseErrors:
    """The estimates against the truth."""
    return pose_errors(history.trajectory, drive.truth)
