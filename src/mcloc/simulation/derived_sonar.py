"""Sonars that were not there: what they would have measured where a laser did, the nearest return
in each cone. Their walls never mirror, and they hear no one else: these are *derived* readings.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.events import Event, Scan
from mcloc.io.messages import Skipped
from mcloc.simulation.sonar import ring_angles

CALLED = "derived sonar"
CONE = math.radians(20.0)
REACH = 5.0  # m
FEWEST, MOST = 7, 24


@dataclass(frozen=True)
class DerivedSonar:
    """A ring of `sonars` where the laser is, of which those remain whose whole cone it sees.

    cone: rad. reach: m; what is farther gives no return. Raises ConfigError for what is no ring.
    """

    sonars: int = 16
    cone: float = CONE
    reach: float = REACH

    def __post_init__(self) -> None:
        if not FEWEST <= self.sonars <= MOST:
            raise ConfigError(
                f"a ring has {FEWEST} to {MOST} sonars, got {self.sonars}; give such a number"
            )
        if not (0.0 < self.cone <= math.pi and 0.0 < self.reach < math.inf):
            raise ConfigError(
                f"sonars need a cone of 0 to π rad and a reach > 0 m, got {self.cone:g} and "
                f"{self.reach:g}"
            )

    def of(self, scan: Scan) -> Scan:
        """What the ring would have measured: inf where nothing in a cone is within reach, NaN where
        no beam in it is a reading. It has no sonars where the laser sees no whole cone.
        """
        reach = min(self.reach, scan.range_max)
        nothing = scan.ranges >= scan.range_max  # inf, too: that is a reading
        echo = np.where(scan.returned, scan.ranges, np.where(nothing, np.inf, np.nan))
        axes = ring_angles(self.sonars)
        # (sonars, beams): how far each beam is beside each axis.
        aside = np.abs(_wrapped(scan.angles - axes[:, None]))
        inside = aside <= 0.5 * self.cone + 1e-9
        nearest = np.min(np.where(inside & ~np.isnan(echo), echo, np.inf), axis=1, initial=np.inf)
        heard = np.any(inside & ~np.isnan(echo), axis=1)
        found = np.where(heard, np.where(nearest < reach, nearest, np.inf), np.nan)
        seen = self._covered(scan.angles, axes)
        source = f"{CALLED} ({scan.source})"
        return replace(scan, ranges=found[seen], angles=axes[seen], range_max=reach, source=source)

    def instead(self, events: Iterator[Event], skipped: Skipped) -> Iterator[Event]:
        """The events of a log with derived scans in the place of its own."""
        for event in events:
            yield self.of(event) if isinstance(event, Scan) else event

    def _covered(self, angles: NDArray[np.float64], axes: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(sonars,): whether the beams reach both edges of a cone, to half the gap between two."""
        if len(angles) < 2:
            return np.zeros(len(axes), dtype=np.bool_)
        gap = float(np.median(np.abs(np.diff(angles))))
        within = np.ones(len(axes), dtype=np.bool_)
        for edge in (-0.5 * self.cone, 0.5 * self.cone):
            off = np.abs(_wrapped(angles - (axes + edge)[:, None])).min(axis=1)
            within &= off <= 0.5 * gap + 1e-9
        return within


def _wrapped(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same angles, from −π to π."""
    wrapped: NDArray[np.float64] = np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi
    return wrapped
