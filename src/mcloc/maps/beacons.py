"""Radio beacons: places that a robot measures its distance to."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import MapError
from mcloc.maps.occupancy import FARTHEST
from mcloc.textfile import TextFile

COLUMNS = "beacon_id", "x", "y", "z"


@dataclass(frozen=True, eq=False)
class Beacons:
    """names: as users and logs call them. places: (L, 3) metres, map frame; heights above the
    floor.

    Raises MapError for tables that do not fit, places that are not finite, and names that are there
    twice.
    """

    names: Sequence[str]
    places: NDArray[np.float64]
    name: str = "beacons"  # of the file, for messages

    def __post_init__(self) -> None:
        if len(self.names) == 0:
            raise MapError(f"{self.name}: there is no beacon in it")
        places = np.array(self.places, dtype=np.float64)
        if places.shape != (len(self.names), 3) or not (np.abs(places) < FARTHEST).all():
            raise MapError(
                f"{self.name}: each beacon needs finite x, y, z in metres, less than {FARTHEST:g} "
                "away"
            )
        if len(set(self.names)) < len(self.names):
            twice = next(name for name in self.names if list(self.names).count(name) > 1)
            raise MapError(f"{self.name}: beacon {twice} is there twice; remove one of them")
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "places", places)

    @cached_property
    def checksum(self) -> str:
        """The same for the same beacons."""
        told = "\n".join(self.names).encode() + self.places.tobytes()
        return hashlib.sha256(told).hexdigest()


def read_beacons(path: str | Path) -> Beacons:
    """The beacons in a CSV file with a header that names beacon_id, x, y and z (m, map frame).

    Raises MapError for a file that is missing, unreadable or empty, and for a row that is none.
    """
    text = TextFile(str(path), MapError)
    names: list[str] = []
    places: list[list[float]] = []
    for line, row in text.records(COLUMNS):
        if row["beacon_id"] in names:
            raise text.fault(line, f"beacon {row['beacon_id']} is there twice; remove one of them")
        names.append(row["beacon_id"])
        places.append([text.number(line, axis, row[axis], FARTHEST) for axis in COLUMNS[1:]])
    return Beacons(names, np.array(places).reshape(-1, 3), name=str(path))


def write_beacons(beacons: Beacons, path: str | Path) -> None:
    """Write them as `read_beacons` reads them. Raises MapError where nothing can be written."""
    rows = [
        f"{name},{x:.3f},{y:.3f},{z:.3f}\n"
        for name, (x, y, z) in zip(beacons.names, beacons.places.tolist(), strict=True)
    ]
    try:
        Path(path).write_text(",".join(COLUMNS) + "\n" + "".join(rows), encoding="utf-8")
    except OSError as cause:
        raise MapError(f"{path}: cannot be written to ({cause.strerror})") from cause
