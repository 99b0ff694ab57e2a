"""What a robot reports: events with stamps, in the robot's own frames."""

from collections.abc import Iterator
from dataclasses import fields
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mcloc.events.beacon_ranges import BeaconRanges
from mcloc.events.detection import Detection
from mcloc.events.image import Image
from mcloc.events.message import Message
from mcloc.events.odometry import Odometry
from mcloc.events.scan import Scan
from mcloc.events.sightings import UNKNOWN, Sightings

__all__ = [
    "MEASUREMENTS",
    "UNKNOWN",
    "BeaconRanges",
    "Detection",
    "Event",
    "Image",
    "Log",
    "Measurement",
    "Message",
    "Odometry",
    "Scan",
    "Sightings",
    "arrays_of",
]

Measurement = Scan | Sightings | BeaconRanges | Image | Message

MEASUREMENTS: tuple[type[Measurement], ...] = (Scan, Sightings, BeaconRanges, Image, Message)

Event = Odometry | Measurement


def arrays_of(event: Event) -> dict[str, NDArray[np.float64]]:
    """{name: array} of an event's fields that are arrays."""
    values = {f.name: getattr(event, f.name) for f in fields(event)}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}


class Log(Protocol):
    """A recorded log: iterate over it to get its events, in the order of the file, streaming.

    Iterating again starts again. Raises LogError in mid-stream where the file is cut or spoilt:
    events before the damage have been delivered. `skipped` counts, by reason, what the last
    iteration left out.
    """

    path: str
    skipped: dict[str, int]

    def __iter__(self) -> Iterator[Event]: ...
