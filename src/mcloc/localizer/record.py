"""How well each sensor has fitted so far: what beacons are trusted by."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from mcloc.events import BeaconRanges, Measurement
from mcloc.localizer.estimate import Update
from mcloc.protocols import SensorModel

SURE = 0.9  # share of the belief at one place


@dataclass(frozen=True, slots=True)
class Record:
    """Of the readings of one sensor, counted where the filter was sure of the place.

    heard: how many of them were news. failed: how many of these the map did not explain at the best
    hypothesis. conclusive: whether they are, see Measured.
    """

    heard: float = 0.0
    failed: float = 0.0
    conclusive: bool = True

    def with_reading(self, novelty: float, explained: float) -> "Record":
        """With one more; NaN explains nothing and fails in nothing."""
        if math.isnan(explained):
            return self
        failed = self.failed + novelty * (1.0 - explained)
        return replace(self, heard=self.heard + novelty, failed=failed)

    @property
    def share_failed(self) -> float:
        """Of the readings, 0 … 1; NaN before the first one."""
        return self.failed / self.heard if self.heard > 0.0 else math.nan


Records = dict[str, Record]
"""By sensor: a laser's name, or that of a beacon."""


def told(z: Measurement, records: Mapping[str, Record], alone: bool = True) -> Measurement:
    """A measurement with what is known of the sensors that it comes from. alone: whether beacons
    are all that the robot was heard to have.
    """
    if not isinstance(z, BeaconRanges):
        return z
    of = [records.get(one.source, Record()) for one in z.parts()]
    heard, failed = (np.array([getattr(r, name) for r in of]) for name in ("heard", "failed"))
    usual = _usual(records)
    return replace(z, heard=heard, failed=failed, usual=usual, alone=alone)


def _usual(records: Mapping[str, Record]) -> float:
    """The share of readings that failed of a typical sensor, the median: of those that are no
    beacons, if there are any. Beacons that were surveyed in another frame all fail, and must not
    excuse each other.
    """
    heard = [record for record in records.values() if record.heard > 0.0]
    others = [record for record in heard if record.conclusive]
    shares = [record.share_failed for record in others or heard]
    return float(np.median(shares)) if shares else 0.0


def noted(
    records: Records, z: Measurement, novelty: float, update: Update, sensor: SensorModel
) -> None:
    """Take note of how the readings of an update fitted; the beacons are judged one by one.

    A filter that may be in several places knows nothing of how its sensors do; and what others
    tell is of no sensor of the robot's.
    """
    if not z.own or not update.hypotheses or update.hypotheses[0].share < SURE:
        return
    found = {z.source: update.explained}
    if isinstance(z, BeaconRanges):
        best = np.ascontiguousarray(update.hypotheses[0].mean[:, None])
        found = {one.source: float(sensor.explained(best, one)[0]) for one in z.parts()}
    for name, explained in found.items():
        record = records.get(name, Record(conclusive=z.conclusive))
        records[name] = record.with_reading(novelty, explained)
