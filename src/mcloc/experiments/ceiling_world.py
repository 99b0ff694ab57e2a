"""The world of E7 and E12: a museum with a robot that sees nothing but the ceiling."""

from functools import lru_cache

from numpy.typing import ArrayLike

from mcloc.evaluation.errors import PoseErrors, pose_errors
from mcloc.filters.catalog import Composition
from mcloc.localizer import Localizer, UpdatePolicy
from mcloc.localizer.pace import Pace
from mcloc.report.history import History
from mcloc.simulation import CeilingDrive, CeilingTour, ceiling_drive, museum_world

MODEL = "ceiling-brightness"  # what the papers measure
LOST = 2.0  # m
SIGMA = (0.2, 0.2, 0.1)  # of a start that is known; m, m, rad
EACH_IMAGE = UpdatePolicy(distance=0.0, angle=0.0, decorrelation=1e-3)
"""Each image is used, and counts in full."""


@lru_cache(maxsize=2)  # runs come seed by seed, and settings share drives
def museum_drive(seed: int, tour: CeilingTour) -> CeilingDrive:
    """A drive through a museum of its own for each seed, under a ceiling of its own."""
    return ceiling_drive(museum_world(seed), seed, tour)


def watched(
    drive: CeilingDrive,
    composition: Composition,
    seed: int,
    *,
    initial: ArrayLike | None = None,
    policy: UpdatePolicy | None = None,
    pace: Pace | None = None,
) -> tuple[History, Localizer]:
    """What was found at each image, and the localizer after the last one; as `localized`."""
    localizer = Localizer(
        drive.grid,
        composition,
        aids=[drive.mosaic],
        seed=seed,
        initial=initial,
        initial_sigma=SIGMA,
        policy=policy,
        pace=pace,
    )
    history = History()
    for estimate in localizer.run(drive):
        history.add(estimate)
    return history, localizer


def errors_under(drive: CeilingDrive, history: History) -> PoseErrors:
    """The estimates against the truth."""
    return pose_errors(history.trajectory, drive.truth)
