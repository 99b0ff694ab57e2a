"""The world of E12: a museum with a robot that sees nothing but the ceiling."""

from functools import lru_cache

from numpy.typing import ArrayLike

from mcloc.evaluation.errors import PoseErrors, pose_errors
from mcloc.filters.catalog import Composition
from mcloc.localizer import Localizer
from mcloc.report.history import History
from mcloc.simulation import CeilingDrive, CeilingTour, ceiling_drive, museum_world

MODEL = "ceiling-brightness"  # what the papers measure
LOST = 2.0  # m
SIGMA = (0.2, 0.2, 0.1)  # of a start that is known; m, m, rad


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
) -> tuple[History, Localizer]:
    """What was found at each image, and the localizer after the last one; as `localized`."""
    localizer = Localizer(
        drive.grid,
        composition,
        aids=[drive.mosaic],
        seed=seed,
        initial=initial,
        initial_sigma=SIGMA,
    )
    history = History()
    for estimate in localizer.run(drive):
        history.add(estimate)
    return history, localizer


def errors_under(drive: CeilingDrive, history: History) -> PoseErrors:
    """The estimates against the truth."""
    return pose_errors(history.trajectory, drive.truth)
