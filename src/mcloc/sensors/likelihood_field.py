"""log p(z | x) = β Σ_k log( z_hit · exp(−d_k²/2σ²) + z_rand · c ), d_k the distance from the k-th
endpoint to the nearest wall  [Thrun, Burgard, Fox: Probabilistic Robotics, §6.4].
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import MapError
from mcloc.events import Scan
from mcloc.kernels.distance import squared_distance
from mcloc.maps.cell_table import CellTable
from mcloc.registry import param
from mcloc.sensors.beams import ScanModel
from mcloc.statespace import LogWeights, States

NOTHING = 1e-6


@dataclass(frozen=True)
class LikelihoodField(ScanModel):
    """Likelihood field of a map, for laser scans.

    One beam's p is relative to that of a perfect reading: (1 − z) exp(−d²/2σ²) + z with z = z_rand
    where the endpoint falls on a known cell and z = z_unknown where it falls on an unknown one or
    off the map. A map maker who saw a surface drew it, so a return from where nobody looked
    surprises more than one from a thing that stands in free space since.

    Readings that are no return have no endpoint: they count among the beams used but say nothing.

    log p is held to 16 bits between the largest and the least that it can be, log 1 and log
    z_unknown: with the defaults within 2.3 · 10⁻⁵ for each beam, before tempering.
    """

    sigma_hit: float = param(0.1, "m", "deviation of endpoints from walls", low=1e-3, high=5)
    z_rand: float = param(
        0.1, "", "p of a reading that no wall explains, a perfect one being 1", above=0, high=1
    )
    z_unknown: float = param(0.05, "", "the same where the map is unknown", above=0, high=1)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._tables  # noqa: B018 - ready before the first scan, and before threads ask for it

    @property
    def table(self) -> CellTable:
        """log p of a beam that ends in a cell."""
        return self._tables[0]

    @cached_property
    def _tables(self) -> tuple[CellTable, CellTable]:
        """log p of a beam that ends in a cell; 1 within 3 σ_hit of a wall, else 0.

        Both depend on the distance in cells alone, whose square is a whole number: the values are
        computed once for each of these, up to where walls explain nothing any more.
        """
        margin = int(np.ceil(self._farthest / self.grid.resolution)) + 1
        try:
            squared = squared_distance(np.pad(self.grid.occupied, margin))
        except MapError as cause:
            raise MapError(
                f"{self.grid.name}: with {margin} cells around it, as far as sensor.sigma_hit = "
                f"{self.sigma_hit:g} m lets walls tell: {cause}; use a smaller one"
            ) from None
        most = np.int32(min(margin**2, int(squared.max())))
        np.minimum(squared, most, out=squared)
        d = self.grid.resolution * np.sqrt(np.arange(int(most) + 1))
        hit = np.exp(-0.5 * (d / self.sigma_hit) ** 2)
        log_p = [np.log((1.0 - z) * hit + z) for z in (self.z_rand, self.z_unknown)]
        near = CellTable.chosen(self.grid, (d <= 3.0 * self.sigma_hit).astype(np.float64), squared)
        unknown = np.pad(self.grid.unknown, margin, constant_values=True)
        np.add(squared, most + 1, out=squared, where=unknown)
        return CellTable.chosen(self.grid, np.concatenate(log_p), squared), near

    @property
    def _farthest(self) -> float:
        """Metres from a wall from where on it adds less than 10⁻⁶ to any log p."""
        least = min(self.z_rand, self.z_unknown)
        return self.sigma_hit * math.sqrt(-2.0 * (math.log(NOTHING) + math.log(least)))

    def endpoints(self, z: Scan) -> NDArray[np.float64]:
        """(B, 2): where the used beams end, metres, robot frame; beams without a return left
        out.
        """
        beams = self.used_beams(z)
        beams = beams[z.returned[beams]]
        r, a = z.ranges[beams], z.angles[beams] + z.mount[2]
        points = np.empty((len(beams), 2))
        points[:, 0] = z.mount[0] + r * np.cos(a)
        points[:, 1] = z.mount[1] + r * np.sin(a)
        return points

    def log_likelihood(self, x: States, z: Scan) -> LogWeights:
        """(n,): log p(z | x), 0 for a perfect scan."""
        return self.table.summed(self.endpoints(z))(x) * self.tempering(z)

    def explained(self, x: States, z: Scan) -> NDArray[np.float64]:
        """(n,): the share of returns that end within 3 σ_hit of a wall; NaN for a scan without
        returns.
        """
        points = self.endpoints(z)
        if len(points) == 0:
            return np.full(x.shape[1], np.nan)
        return self._tables[1].summed(points)(x) / len(points)
