"""What a run found at each scan, in numbers; all that its files and its summary are made of."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mcloc.events import Message, Sightings
from mcloc.geometry import Pose, between, compose, transported
from mcloc.localizer import Estimate, Localizer
from mcloc.report.rows import Rows
from mcloc.trajectory import Trajectory

UPPER = np.triu_indices(3)  # of a covariance: xx, xy, xt, yy, yt, tt
COLUMNS = (
    *("t", "x", "y", "theta", "cov_xx", "cov_xy", "cov_xt", "cov_yy", "cov_yt", "cov_tt"),
    *("n_particles", "ess", "n_hypotheses", "share", "likelihood_fast", "likelihood_slow"),
    "explained_beams",
)
"""Of estimates.csv: m, rad, s."""

ALL = (*COLUMNS, "carried", "odometry_x", "odometry_y", "odometry_theta")

SILENT = 0.5  # s without a measurement after which the wheels alone carry an estimate along


class History:
    """A row for each stamp with an estimate, one for each update that told one, the scans at which
    none was told, the stamps of the sightings of landmarks that were used, and the sizes of all
    sample sets drawn.
    """

    def __init__(self) -> None:
        self.rows = Rows(len(ALL))
        self.updates = Rows(3)  # t, seconds that it took, particles
        self.withheld = Rows(4)  # t, x, y, θ of the wheels, of scans without an estimate
        self.sighted = Rows(1)  # t
        self.sizes = Rows(3)  # step, which of its sets, particles

    def __len__(self) -> int:
        return len(self.rows)

    def add(self, e: Estimate) -> None:
        """Take note of an estimate; of two with the same stamp, by two lasers, the later stays.

        Where the clock was set back, what has a later stamp goes: it would contradict this.
        """
        info, evidence = e.update.info, e.update.info.evidence
        carried = float(isinstance(e.measurement, Message) and not e.measurement.useful)
        row = (
            *(e.t, *e.pose, *e.covariance[UPPER]),
            *(info.n, info.ess, len(e.hypotheses), e.hypotheses[0].share),
            *(evidence.fast, evidence.slow, e.update.explained, carried, *e.odometry),
        )
        _drop_from(e.t, self.rows)
        _drop_from(e.t, self.withheld)
        self.rows.add(*row)
        if e.updated:
            self.updates.add(e.t, e.update.duration, info.n)
            if isinstance(e.measurement, Sightings):
                self.sighted.add(e.t)
            for nth, n in enumerate(info.sizes):
                self.sizes.add(e.update.step, nth, n)

    def carry(self, localizer: Localizer, t: float) -> None:
        """Carry its last estimate along the wheels to t, if nothing was measured for some time:
        sensors that see landmarks may see none for minutes. Not while the filter withholds.
        """
        odometry = localizer.wheels_at(t)
        if odometry is None or not len(self) or t - self.last("t") < SILENT:
            return
        if len(self.withheld) and self.withheld.last[0] > self.last("t"):
            return
        last = np.array(self.rows.last)
        u = between(last[-3:], odometry)
        covariance = np.empty((3, 3))
        covariance[UPPER] = covariance[UPPER[::-1]] = last[4:10]
        moved = transported(last[1:4], covariance, u)[UPPER]
        told = last[10 : ALL.index("explained_beams")]
        self.rows.add(t, *compose(last[1:4], u), *moved, *told, np.nan, 1.0, *odometry)

    def withhold(self, t: float, odometry: Pose) -> None:
        """Take note of a scan for which the filter told no pose; odometry: (3,) of the wheels."""
        _drop_from(t, self.withheld)
        self.withheld.add(t, *odometry)

    def last(self, name: str) -> float:
        """The last number of a column."""
        return self.rows.last[ALL.index(name)]

    def column(self, name: str) -> NDArray[np.float64]:
        """(N,): the numbers of a column."""
        return self.rows.table[:, ALL.index(name)]

    @property
    def trajectory(self) -> Trajectory:
        """The most likely hypothesis at each scan, with its covariance and share."""
        table = self.rows.table
        covariances = np.empty((len(table), 3, 3))
        covariances[:, *UPPER] = covariances[:, *UPPER[::-1]] = table[:, 4:10]
        return Trajectory(table[:, 0], table[:, 1:4], covariances, self.column("share"))

    @property
    def wheels(self) -> Trajectory:
        """Where the wheels alone say that the robot was at each scan, in their own frame."""
        told = self.rows.table
        table = np.concatenate([told[:, [0, -3, -2, -1]], self.withheld.table])
        _, order = np.unique(table[:, 0], return_index=True)
        return Trajectory(table[order, 0], table[order, 1:])

    @property
    def scans(self) -> int:
        """At how many an estimate was told: all rows but those that the wheels alone carried."""
        return int(np.sum(self.column("carried") == 0.0))

    @property
    def share_withheld(self) -> float:
        """Of the scans, 0 … 1; 0 where there were none, and the wheels alone were followed."""
        return len(self.withheld) / max(len(self.withheld) + self.scans, 1)

    def estimates_csv(self) -> Iterator[str]:
        """Lines: one for each stamp; explained_beams is empty for a scan without returns.

        One run, the same bytes: digits are fixed, no clock is read.
        """
        yield ",".join(COLUMNS)
        for row in self.rows.table:
            yield ",".join(
                [
                    *(f"{value:.6f}" for value in row[:4]),
                    *(f"{value:.9g}" for value in row[4:10]),
                    f"{row[10]:.0f}",
                    f"{row[11]:.3f}",
                    f"{row[12]:.0f}",
                    f"{row[13]:.6f}",
                    *(f"{value:.9g}" for value in row[14:16]),
                    "" if np.isnan(row[16]) else f"{row[16]:.6f}",
                ]
            )

    def timing_csv(self) -> Iterator[str]:
        """Lines: one for each update of the filter."""
        yield "t,update_ms"
        for t, duration, _ in self.updates.table:
            yield f"{t:.6f},{1e3 * duration:.3f}"


def _drop_from(t: float, rows: Rows) -> None:
    """Take away the last rows that are not from before t."""
    while len(rows) and rows.last[0] >= t:
        rows.drop_last()
