"""Estimate: where the robot is at the stamp of a measurement, and what that rests on."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcloc.estimate import Hypothesis
from mcloc.events import Measurement
from mcloc.filters.filter import StepInfo
from mcloc.geometry import Pose, compose, transported
from mcloc.particles import Particles


@dataclass(frozen=True, eq=False, slots=True)
class Update:
    """What the filter found at its last update.

    step: its number, from 1. info: of the filter's step. particles: after it. hypotheses: at the
    time of the update. explained: share of the readings that the map explains at the best
    hypothesis, NaN without readings. duration: seconds of computing.
    """

    step: int
    info: StepInfo
    particles: Particles
    hypotheses: tuple[Hypothesis, ...]
    explained: float
    duration: float


@dataclass(frozen=True, eq=False, slots=True)
class Estimate:
    """Where the robot is at the stamp of a measurement, map frame.

    measurement: what a sensor told then, such as a Scan. odometry: (3,) the wheels' pose at its
    stamp, odometry frame. hypotheses: most likely first, carried along by odometry since the
    update. update: the last one. updated: whether it was made with this very measurement.
    """

    measurement: Measurement
    odometry: Pose
    hypotheses: tuple[Hypothesis, ...]
    update: Update
    updated: bool

    @property
    def t(self) -> float:
        """Seconds: the measurement's stamp."""
        return self.measurement.t

    @property
    def pose(self) -> Pose:
        """(3,): the most likely hypothesis; m, m, rad."""
        return self.hypotheses[0].mean

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(3, 3): of that hypothesis."""
        return self.hypotheses[0].covariance


def carried(h: Hypothesis, u: NDArray[np.float64]) -> Hypothesis:
    """A hypothesis after the move u, its covariance turned along; the noise of the move waits for
    the next update.
    """
    if not u.any():
        return h
    return replace(h, mean=compose(h.mean, u), covariance=transported(h.mean, h.covariance, u))
