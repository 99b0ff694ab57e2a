"""log p(z | x) = β Σ_k log( p(z_k | e_k) / max_e p(z_k | e) ), e_k the range that the map lets
expect of the k-th beam from x  [Thrun, Burgard, Fox: Probabilistic Robotics, §6.3; Fox01 §19.2.2].
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import MapError
from mcloc.events import Scan
from mcloc.maps.cone_caster import ConeCaster
from mcloc.maps.range_table import RangeTable
from mcloc.maps.ray_caster import RayCaster
from mcloc.registry import param
from mcloc.sensors.beam_densities import no_return, uniform
from mcloc.sensors.beams import ScanModel
from mcloc.statespace import LogWeights, States

KNOTS_PER_SIGMA = 4.0
FARTHEST = 1e4  # m; no laser reaches there: a larger range_max states no limit
MOST_REACHES = 4  # of lasers on one robot, for which tables are kept
LEAST = 1e-300  # density; below, logarithms would be −∞ at one knot and interpolate to NaN


@dataclass(frozen=True)
class BeamModel(ScanModel, ABC):
    """Beam model of a range finder: expected ranges by exact ray casting, a mixture around them.

    Readings from range_min to below range_max are returns; inf or anything from range_max on is
    "nothing within reach", which is information. NaN, −inf and what is ≤ 0 or below range_min are
    errors of the sensor and say nothing. Where a beam leaves known space before it meets a wall,
    there is no expected range, and the reading is anything in reach with 1 − p_max_unknown, or no
    return with p_max_unknown. Cells within σ_hit in front of a wall that the map leaves undecided
    count as the blurred face of the wall. Where range_max is inf, or more than any laser has, the
    reach is the map's diagonal.

    The beam of a sonar is a cone, in which it measures the nearest wall: with `cone` a fan of rays
    is cast for each beam (maps/cone_caster), which takes as many times longer; looked up, it takes
    no longer. Noise may grow with the expected range e: the deviation of returns is then
    √(σ_hit² + (sigma_relative · e)²).

    A beam's p is relative to that of the expected range which explains the reading best, so log
    p ≤ 0 and a perfect scan has 0; this factor does not depend on x. Of each scan a table of log p
    over the expected range is made, with knots σ_hit / 4 apart and straight lines between: the
    error per beam, before tempering, is below 0.03 (0.04 where sigma_relative is above 0.1), except
    within one knot of where the density itself jumps.

    With ranges = table, expected ranges are looked up instead of cast, some 25 times as fast: those
    from the middle of each cell, in table_angles directions. What that errs by, and the memory that
    it takes, is told in maps/range_table. Both the reading and the expected range are then held to
    the nearest knot, up to σ_hit / 8 away.
    """

    sigma_hit: float = param(
        0.2, "m", "deviation of returns from the expected range", low=1e-3, high=5
    )
    sigma_relative: float = param(
        0.0, "m/m", "deviation that grows with the expected range", low=0, high=0.3
    )
    cone: float = param(
        0.0,
        "rad",
        "opening angle of a beam, which measures the nearest wall in it; 0: a ray",
        low=0,
        high=np.pi,
    )
    p_max_unknown: float = param(
        0.5, "", "chance of no return where a beam leaves known space", above=0, high=0.999
    )
    ranges: str = param(
        "exact",
        "",
        "expected ranges: exact ones, or quick ones from a table",
        choices=("exact", "table"),
    )
    table_angles: int = param(
        180, "", "directions in the table, around the circle", low=4, high=1e4
    )
    table_memory: float = param(1000.0, "MB", "most memory of the table of ranges", above=0)

    _lock: Lock = field(default_factory=Lock, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.ranges == "table":
            self.range_table  # noqa: B018 - a table that is too large is refused here

    @abstractmethod
    def mixture(
        self, z: NDArray[np.float64], e: NDArray[np.float64], range_max: float
    ) -> NDArray[np.float64]:
        """p(z | e) where there is an expected range e, inf for none within reach."""

    def density(
        self, z: NDArray[np.float64], e: NDArray[np.float64], range_max: float
    ) -> NDArray[np.float64]:
        """p(z | e), broadcast: per metre for z < range_max, the probability of no return from
        there on.

        e: expected range, inf where no wall is nearer than range_max, NaN where it is unknown.
        """
        reading = np.minimum(z, range_max)
        known = self.mixture(reading, np.where(np.isnan(e), 0.0, e), range_max)
        p = self.p_max_unknown
        unknown = (1.0 - p) * uniform(reading, range_max) + p * no_return(reading, range_max)
        return np.where(np.isnan(e), unknown, known)

    def reach(self, range_max: float) -> float:
        """Metres: a scan's range_max, or where that states no limit, the map's diagonal."""
        return range_max if range_max <= FARTHEST else self.rays.farthest(range_max)

    def log_likelihood(self, x: States, z: Scan) -> LogWeights:
        """(n,): log p(z | x), 0 for a perfect scan."""
        beams, reach = self.used_beams(z), self.reach(z.range_max)
        beams = beams[z.returned[beams] | (z.ranges[beams] >= reach)]
        readings, angles = z.ranges[beams], z.angles[beams]
        if self.ranges == "table":
            log_p, which = self.log_of_knots(reach), self.nearest_knots(readings, reach)
            total = self.range_table.sum(x, z.mount, angles, log_p, which)
        else:
            table = self._log_table_of(readings, reach)
            total = self.caster.sum(x, z.mount, angles, reach, table, self.spacing)
        return total * self.tempering(z)

    def explained(self, x: States, z: Scan) -> NDArray[np.float64]:
        """(n,): the share of returns within 3 deviations of the expected range; NaN for a scan
        without returns.
        """
        beams = self.used_beams(z)
        beams = beams[z.returned[beams]]
        if len(beams) == 0:
            return np.full(x.shape[1], np.nan)
        expected = self.caster.ranges(x, z.mount, z.angles[beams], z.range_max)
        near: NDArray[np.float64] = np.mean(
            np.abs(expected - z.ranges[beams])
            <= 3.0 * self.deviation(expected, self.reach(z.range_max)),
            axis=1,
        )
        return near

    def deviation(self, e: NDArray[np.float64], range_max: float) -> NDArray[np.float64]:
        """Of returns from a wall at e, metres; from range_max on it does not grow."""
        sigma: NDArray[np.float64] = np.hypot(
            self.sigma_hit, self.sigma_relative * np.minimum(e, range_max)
        )
        return sigma

    @property
    def spacing(self) -> float:
        return self.sigma_hit / KNOTS_PER_SIGMA

    @cached_property
    def rays(self) -> RayCaster:
        return RayCaster(self.grid, self.sigma_hit)

    @cached_property
    def caster(self) -> RayCaster | ConeCaster:
        """Of the expected ranges."""
        return ConeCaster(self.rays, self.cone) if self.cone > 0.0 else self.rays

    @cached_property
    def range_table(self) -> RangeTable:
        return RangeTable(self.rays, self.table_angles, self.spacing, self.table_memory, self.cone)

    def _log_table_of(self, readings: NDArray[np.float64], reach: float) -> NDArray[np.float32]:
        """`log_table`, made once for all the threads and blocks that a scan is weighed by."""
        asked = readings.tobytes(), reach
        with self._lock:
            self.rays.prepare()
            if asked not in self._of_scan:
                self._of_scan.clear()
                self._of_scan[asked] = self._in_pieces(readings, reach)
            return self._of_scan[asked]

    def _in_pieces(self, readings: NDArray[np.float64], reach: float) -> NDArray[np.float32]:
        """`log_table` a few readings at a time: in double precision all take much memory."""
        pieces = [self.log_table(readings[k : k + 16], reach) for k in range(0, len(readings), 16)]
        return np.concatenate(pieces) if pieces else self.log_table(readings, reach)

    @cached_property
    def _of_scan(self) -> dict[tuple[bytes, float], NDArray[np.float32]]:
        return {}

    def log_of_knots(self, reach: float) -> NDArray[np.float32]:
        """log p of every reading that is a knot, and of no return, for `RangeTable.sum`. Raises
        MapError where they are too many.
        """
        with self._lock:
            if reach not in self._tables:
                if len(self._tables) == MOST_REACHES:
                    self._tables.clear()
                self._tables[reach] = self._of_all_knots(reach)
            return self._tables[reach]

    def _of_all_knots(self, reach: float) -> NDArray[np.float32]:
        knots = self.spacing * np.arange(int(np.ceil(reach / self.spacing)))
        looked_up = self.range_table
        wanted = 4e-6 * (len(knots) + 1) * (looked_up.steps + 1)
        if wanted > self.table_memory:
            raise MapError(
                f"{self.grid.name}: log p for readings up to {reach:g} m in steps of "
                f"sensor.sigma_hit / 4 takes {wanted:.0f} MB, more than sensor.table_memory = "
                f"{self.table_memory:g} MB; use sensor.ranges=exact, or a larger sensor.sigma_hit"
            )
        readings = np.append(knots, reach)
        return np.concatenate(
            [  # a few at a time: in double precision all would take several times the memory
                looked_up.spread(self.log_table(readings[k : k + 64], reach), reach)
                for k in range(0, len(readings), 64)
            ]
        )

    @cached_property
    def _tables(self) -> dict[float, NDArray[np.float32]]:
        return {}

    def nearest_knots(self, readings: NDArray[np.float64], reach: float) -> NDArray[np.intp]:
        """Which row of that each reading has."""
        rows = int(np.ceil(reach / self.spacing))
        knot = np.minimum(np.rint(np.minimum(readings, reach) / self.spacing), rows - 1)
        return np.where(readings < reach, knot, rows).astype(np.intp)

    def log_table(self, readings: NDArray[np.float64], range_max: float) -> NDArray[np.float32]:
        """(B, K + 2): log p of each reading over the expected range, as RayCaster.sum wants it."""
        knots = 2 + int(self.rays.farthest(range_max) / self.spacing)
        expected = np.concatenate([self.spacing * np.arange(knots), [np.inf, np.nan]])
        p = self.density(readings[:, None], expected, range_max)
        # The best expected range may lie between knots, or beyond what this map has to offer.
        just_behind = np.nextafter(readings, np.inf)[:, None]
        best = np.maximum(
            p.max(axis=1, keepdims=True),
            self.density(readings[:, None], just_behind, range_max),
        )
        table: NDArray[np.float32] = np.log(np.maximum(p, LEAST) / best).astype(np.float32)
        return table
