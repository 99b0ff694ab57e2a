"""Estimates as tables of text. One run, the same bytes: digits are fixed, no clock is read."""

from collections.abc import Iterable, Sequence

import numpy as np

from mcloc.localizer import Estimate
from mcloc.trajectory import Trajectory

ESTIMATES = (
    "t,x,y,theta,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt,n_particles,ess,n_hypotheses,share,"
    "likelihood_fast,likelihood_slow,explained_beams"
)


def estimates_csv(estimates: Iterable[Estimate]) -> str:
    """One row for each usable scan; m, rad, s. explained_beams is empty for a scan without any."""
    return "\n".join([ESTIMATES, *map(_row, estimates), ""])


def timing_csv(estimates: Iterable[Estimate]) -> str:
    """One row for each update of the filter."""
    rows = [f"{e.t:.6f},{1e3 * e.update.duration:.3f}" for e in estimates if e.updated]
    return "\n".join(["t,update_ms", *rows, ""])


def trajectory_of(estimates: Sequence[Estimate]) -> Trajectory:
    """The most likely hypothesis at each scan, with its covariance and share."""
    return Trajectory(
        np.array([e.t for e in estimates]),
        np.array([e.pose for e in estimates]),
        np.array([e.covariance for e in estimates]),
        np.array([e.hypotheses[0].share for e in estimates]),
    )


def _row(e: Estimate) -> str:
    info, explained = e.update.info, e.update.explained
    covariance = e.covariance[np.triu_indices(3)]
    return ",".join(
        [
            *(f"{value:.6f}" for value in (e.t, *e.pose)),
            *(f"{value:.9g}" for value in covariance),
            f"{info.n}",
            f"{info.ess:.3f}",
            f"{len(e.hypotheses)}",
            f"{e.hypotheses[0].share:.6f}",
            f"{info.evidence.fast:.9g}",
            f"{info.evidence.slow:.9g}",
            "" if np.isnan(explained) else f"{explained:.6f}",
        ]
    )
