"""Radio beacons: places that a robot measures its distance to."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from mcloc.errors import MapError
from mcloc.maps.named_places import NamedPlaces
from mcloc.maps.occupancy import FARTHEST
from mcloc.textfile import TextFile

COLUMNS = "beacon_id", "x", "y", "z"


@dataclass(frozen=True, eq=False)
class Beacons(NamedPlaces):
    """Radio beacons by name, at places (L, 3); heights above the floor. Errors: NamedPlaces."""

    called: ClassVar[str] = "beacon"
    axes: ClassVar[tuple[str, ...]] = ("x", "y", "z")

    name: str = "beacons"


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
