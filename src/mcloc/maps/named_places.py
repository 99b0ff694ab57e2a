"""Places that have names: what landmarks and beacons have in common."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import MapError
from mcloc.maps.occupancy import FARTHEST


@dataclass(frozen=True, eq=False)
class NamedPlaces:
    """names: as users and logs call them. places: (L, D) metres, map frame, along `axes`. name: of
    the file, for messages. called: one of them.

    Raises MapError for tables that do not fit, places that are not finite, and names that are there
    twice.
    """

    called: ClassVar[str]
    axes: ClassVar[tuple[str, ...]]

    names: Sequence[str]
    places: NDArray[np.float64]
    name: str

    def __post_init__(self) -> None:
        if len(self.names) == 0:
            raise MapError(f"{self.name}: there is no {self.called} in it")
        places = np.array(self.places, dtype=np.float64)
        fits = places.shape == (len(self.names), len(self.axes))
        if not fits or not (np.abs(places) < FARTHEST).all():
            raise MapError(
                f"{self.name}: each {self.called} needs finite {', '.join(self.axes)} in metres, "
                f"less than {FARTHEST:g} away"
            )
        if len(set(self.names)) < len(self.names):
            twice = next(name for name in self.names if list(self.names).count(name) > 1)
            raise MapError(f"{self.name}: {self.called} {twice} is there twice; remove one of them")
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "places", places)

    @cached_property
    def checksum(self) -> str:
        """The same for the same places."""
        told = "\n".join(self.names).encode() + self.places.tobytes()
        return hashlib.sha256(told).hexdigest()
