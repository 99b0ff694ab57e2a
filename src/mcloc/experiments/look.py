"""What a belief says of the place, against the truth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mcloc.estimate import Hypothesis
from mcloc.geometry import Pose, wrap

NEAR, TURNED = 1.0, float(np.deg2rad(20.0))  # m, rad, within which two poses are one place
COMPACT = 2.0  # m; samples that scatter by more are no place
SOME, NEARLY, ALL = 0.05, 0.9, 0.95  # of the belief


@dataclass(frozen=True)
class Place:
    """Where the robot may be, and how much of the belief says so."""

    mean: Pose
    share: float


def places(found: Sequence[Hypothesis]) -> list[Place]:
    """The compact ones, those near a larger one taken together, the largest first."""
    merged: list[Place] = []
    for h in sorted(found, key=lambda h: -h.share):
        if h.covariance[0, 0] + h.covariance[1, 1] >= COMPACT**2:
            continue
        for k, place in enumerate(merged):
            if near(h.mean, place.mean):
                merged[k] = Place(place.mean, place.share + h.share)
                break
        else:
            merged.append(Place(h.mean, h.share))
    return sorted((p for p in merged if p.share >= SOME), key=lambda p: -p.share)


def near(a: Pose, b: Pose) -> bool:
    """Whether two poses are one place."""
    return bool(np.hypot(*(a - b)[:2]) <= NEAR and abs(wrap(a[2] - b[2])) <= TURNED)


@dataclass(frozen=True)
class Look:
    """What a belief says: how many places, their part of it, that of the best, of the true one."""

    places: int
    all: float
    best: float
    true: float

    @classmethod
    def at(cls, found: Sequence[Hypothesis], truth: Pose) -> "Look":
        """The hypotheses of a belief against the truth."""
        there = places(found)
        true = sum(p.share for p in there if near(p.mean, truth))
        shares = [p.share for p in there]
        return cls(len(there), sum(shares), max(shares, default=0.0), true)

    @property
    def few(self) -> bool:
        """Up to a single symmetry."""
        return 1 <= self.places <= 2 and self.all >= NEARLY and self.true > 0.0

    @property
    def unique(self) -> bool:
        """One place, whichever."""
        return self.places == 1 and self.best >= ALL

    @property
    def found(self) -> bool:
        """That place, and it is the true one."""
        return self.unique and self.true > 0.0
