"""Expected ranges from a table of all of them, computed once: [cell][angle]."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.errors import MapError
from mcloc.geometry import Pose
from mcloc.kernels.cones import PASSABLE, SOLID
from mcloc.kernels.field import FOUR
from mcloc.kernels.jit import share
from mcloc.kernels.range_table import NOT_KNOWN, fill_rows, sum_over_table
from mcloc.maps.cone_caster import nearest_around
from mcloc.maps.ray_caster import RayCaster
from mcloc.statespace import States

_AT_ONCE = 1 << 20  # rays that are cast at once
MOST_STEPS = 65533  # of a range: more do not fit 16 bits
_ROWS = 2  # before those of the cells: of what is not known, and of walls
_WORK = 0.8  # ns a ray


@dataclass(frozen=True, eq=False)
class RangeTable:
    """The ranges that a caster gives from the middle of each cell, in `angles` directions.

    A ray is taken to begin in the middle of its cell, up to 0.7 cells away, and to go in the
    nearest of the directions, up to π / angles aside; its range is held to the nearest whole
    `spacing`, m. Where walls lie across the ray, all that is an error of up to 0.7 cells + 0.5
    spacings; past an edge, or along a wall, of anything. 2 bytes a passable cell and direction, and
    4 a cell. Raises MapError where that is more than `memory`, MB.

    cone: radians, the opening angle of a beam, which has the range of the nearest wall in it; its
    edges are held to the nearest directions. See `ConeCaster` for where it leaves known space.
    """

    caster: RayCaster
    angles: int
    spacing: float
    memory: float
    cone: float = 0.0

    def __post_init__(self) -> None:
        self.rows  # noqa: B018 - ready before threads ask for it

    def sum(
        self,
        x: States,
        mount: Pose,
        angles: ArrayLike,
        log_p: NDArray[np.float32],
        which: NDArray[np.intp],
    ) -> NDArray[np.float64]:
        """(n,): Σ over the beams of a function of the expected range.

        x: (3, n) poses of the robot in the map frame. mount: (3,) of the sensor on the robot.
        angles: (B,) radians in the sensor's frame. log_p: functions, from `spread`; which: (B,) its
        row for each beam.
        """
        directions = (np.asarray(angles, dtype=np.float64) + mount[2]) * self.angles / (2.0 * np.pi)
        turns = np.zeros(-(-len(directions) // 16) * 16, dtype=np.float32)
        turns[: len(directions)] = np.mod(directions, self.angles)
        turns[turns >= self.angles] = 0.0  # rounded up
        row_of, rows = self.rows
        begins = (which * log_p.shape[1]).astype(np.uint64)
        height, width, *corner, cos, sin, per_cell = self.caster.frame
        frame = (height, width, *corner, cos, sin, float(self.caster.grid.origin[2]), per_cell)
        offset = np.ascontiguousarray(mount[:2], dtype=np.float64)
        out = np.empty(x.shape[1])

        def run(start: int, stop: int) -> None:
            sum_over_table(
                *(x, offset, turns, len(directions), row_of, rows, self.angles),
                *(log_p.ravel(), begins, frame, FOUR, out, start, stop),
            )

        share(run, len(out), len(out) * (10.0 + _WORK * len(directions)))
        return out

    def spread(self, table: NDArray[np.float32], range_max: float) -> NDArray[np.float32]:
        """Functions of the expected range, as `sum` takes them.

        table: (F, K + 2), a row for each function: its values at the ranges 0, spacing, 2 spacing …
        (up to range_max or more), then for no wall nearer than range_max, then for rays that leave
        known space.
        """
        reached = min(int(np.ceil(range_max / self.spacing)), table.shape[1] - 2, self.steps)
        log_p = np.empty((len(table), 1 + self.steps), dtype=np.float32)
        log_p[:, NOT_KNOWN] = table[:, -1]
        log_p[:, 1 : 1 + reached] = table[:, :reached]
        log_p[:, 1 + reached :] = table[:, -2:-1]
        return log_p

    @property
    def steps(self) -> int:
        """More than any range of the map has."""
        return int(self.caster.farthest(np.inf) / self.spacing) + 2

    @cached_property
    def rows(self) -> tuple[NDArray[np.int32], NDArray[np.uint16]]:
        """Which row belongs to each cell of the map and its ring; the rows, one after the other."""
        grid = self.caster.grid
        stops = self.caster.stops.ravel()
        cells = np.flatnonzero(stops == PASSABLE)
        size = (len(cells) + _ROWS) * self.angles
        wanted = (2 * size + 4 * len(stops)) / 1e6
        if size >= 2**32:
            raise MapError(
                f"{grid.name}: {len(cells)} cells in {self.angles} directions are more ranges than "
                "one table can hold; use sensor.ranges=exact, or fewer sensor.table_angles"
            )
        if wanted > self.memory:
            raise MapError(
                f"{grid.name}: the table of expected ranges of its {len(cells)} cells in "
                f"{self.angles} directions takes {wanted:.0f} MB, more than sensor.table_memory = "
                f"{self.memory:g} MB; use sensor.ranges=exact, or fewer sensor.table_angles"
            )
        if self.steps > MOST_STEPS:
            raise MapError(
                f"{grid.name}: {self.caster.farthest(np.inf):.0f} m across are too far for a table "
                f"in steps of sensor.sigma_hit / 4 = {self.spacing:g} m; use sensor.ranges=exact"
            )
        row_of = np.zeros(len(stops), dtype=np.int32)
        row_of[stops == SOLID] = 1
        row_of[cells] = _ROWS + np.arange(len(cells), dtype=np.int32)
        rows = np.empty(size, dtype=np.uint16)
        rows[: self.angles] = 0
        rows[self.angles : _ROWS * self.angles] = 1
        directions = np.linspace(0.0, 2.0 * np.pi, self.angles, endpoint=False)
        steps_per_cell = grid.resolution / self.spacing
        aside = round(self.cone / 2.0 * self.angles / (2.0 * np.pi))
        together = max(_AT_ONCE // self.angles, 1)
        for first in range(0, len(cells), together):
            some = cells[first : first + together]
            lengths = self.caster.from_cells(some, directions)
            if aside > 0:
                lengths = nearest_around(lengths.reshape(-1, self.angles), aside).ravel()
            at = (_ROWS + first) * self.angles
            fill_rows(lengths, steps_per_cell, rows[at : at + len(lengths)])
        return row_of, rows
