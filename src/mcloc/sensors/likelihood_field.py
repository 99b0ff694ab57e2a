"""log p(z | x) = β Σ_k log( z_hit · exp(−d_k²/2σ²) + z_rand · c ), d_k the distance from the k-th
endpoint to the nearest wall  [Thrun, Burgard, Fox: Probabilistic Robotics, §6.4].
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from mcloc.events import Scan
from mcloc.maps.cell_table import CellTable
from mcloc.registry import param
from mcloc.sensors.beams import ScanModel
from mcloc.statespace import LogWeights, States


@dataclass(frozen=True)
class LikelihoodField(ScanModel):
    """Likelihood field of a map, for laser scans.

    One beam's p is relative to that of a perfect reading: (1 − z) exp(−d²/2σ²) + z with z = z_rand
    where the endpoint falls on a known cell and z = z_unknown where it falls on an unknown one or
    off the map. A map maker who saw a surface drew it, so a return from where nobody looked
    surprises more than one from a thing that stands in free space since.

    Readings that are no return have no endpoint: they count among the beams used but say nothing.
    """

    sigma_hit: float = param(0.1, "m", "deviation of endpoints from walls", low=1e-3, high=5)
    z_rand: float = param(
        0.1, "", "p of a reading that no wall explains, a perfect one being 1", above=0, high=1
    )
    z_unknown: float = param(0.05, "", "the same where the map is unknown", above=0, high=1)

    @property
    def _margin(self) -> int:
        """Cells around the map, up to where a wall on its border explains nothing: 5 σ_hit."""
        return int(np.ceil(5.0 * self.sigma_hit / self.grid.resolution)) + 1

    @cached_property
    def _distance(self) -> NDArray[np.float32]:
        """(height + 2 m, width + 2 m): metres to the nearest wall, m = _margin."""
        padded = np.pad(self.grid.occupied, self._margin)
        if not padded.any():
            return np.full(padded.shape, np.inf, dtype=np.float32)
        cells = distance_transform_edt(~padded)
        return (cells * self.grid.resolution).astype(np.float32)

    @cached_property
    def _near(self) -> CellTable:
        """1 within 3 σ_hit of a wall, else 0."""
        return CellTable(self.grid, (self._distance <= 3.0 * self.sigma_hit).astype(np.float32))

    @cached_property
    def _table(self) -> CellTable:
        """log p of a beam that ends in a cell."""
        z = np.where(
            np.pad(self.grid.unknown, self._margin, constant_values=True),
            self.z_unknown,
            self.z_rand,
        )
        hit = np.exp(-0.5 * (self._distance / self.sigma_hit) ** 2)
        return CellTable(self.grid, np.log((1.0 - z) * hit + z).astype(np.float32))

    def endpoints(self, z: Scan) -> NDArray[np.float64]:
        """(B, 2): where the used beams end, metres, robot frame; beams without a return left
        out.
        """
        beams = self.used_beams(z)
        ranges, angles = z.ranges[beams], z.angles[beams]
        ok = z.returned[beams]
        r, a = ranges[ok], angles[ok] + z.mount[2]
        return np.stack([z.mount[0] + r * np.cos(a), z.mount[1] + r * np.sin(a)], axis=1)

    def log_likelihood(self, x: States, z: Scan) -> LogWeights:
        """(n,): log p(z | x), 0 for a perfect scan."""
        return self._table.sum(x, self.endpoints(z)) * self.tempering(z)

    def explained(self, x: States, z: Scan) -> NDArray[np.float64]:
        """(n,): the share of returns that end within 3 σ_hit of a wall; NaN for a scan without
        returns.
        """
        points = self.endpoints(z)
        if len(points) == 0:
            return np.full(x.shape[1], np.nan)
        return self._near.sum(x, points) / len(points)
