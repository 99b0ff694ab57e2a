"""A team at a glance: where its robots were, how well that was known, and when they were told."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mcloc.errors import TruthError
from mcloc.evaluation.errors import PoseErrors, pose_errors
from mcloc.report.picture import LOST, SEEN, broken_at_jumps, logarithmic, zoom
from mcloc.report.team_run import Member, TeamRun
from mcloc.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLORS = ("#1f5fbf", "#c07f1f", "#7b3fa0", "#128a8a", "#a8325e")
LIMIT = 0.5  # m, from which on a robot is off
LEAST = 0.01  # m that are told apart


def draw_team(run: TeamRun, path: Path) -> None:
    """Write a PNG of a team of which at least one robot has an estimate: the paths of all, beside
    the true ones, and the error of each over time, with the moments at which it was told where it
    is.
    """
    from matplotlib.figure import Figure

    members = {name: member for name, member in run.members.items() if len(member.history)}
    colors = {name: COLORS[k % len(COLORS)] for k, name in enumerate(run.members)}
    figure = Figure(figsize=(15.0, 8.0), layout="constrained")
    cells = figure.add_gridspec(len(members), 2, width_ratios=(1.0, 1.0))
    _draw_floor(figure.add_subplot(cells[:, 0]), run, members, colors)
    first = None
    for row, (name, member) in enumerate(members.items()):
        axes = figure.add_subplot(cells[row, 1], sharex=first, sharey=first)
        first = first or axes
        _draw_error(axes, name, member, colors[name])
        axes.tick_params(labelbottom=row == len(members) - 1)
    axes.set_xlabel("t [s]")
    figure.savefig(path, format="png", dpi=110, metadata={"Software": None})


def _draw_floor(
    axes: "Axes", run: TeamRun, members: dict[str, Member], colors: dict[str, str]
) -> None:
    places = next(iter(run.members.values())).log.landmarks.places
    axes.plot(*places.T, "*", color="k", ms=9, mfc=SEEN, label="landmarks")
    shown = [places]
    for name, member in members.items():
        found = member.history.trajectory
        shown.append(found.poses[:, :2])
        if member.truth is not None:
            true = member.truth.poses[:, :2]
            axes.plot(*true.T, color=colors[name], lw=3.5, alpha=0.25)
        axes.plot(
            *broken_at_jumps(found, member.history.wheels).T,
            color=colors[name],
            lw=1.2,
            label=f"robot {name}" if member.sees_landmarks else f"robot {name}, sees no landmarks",
        )
    zoom(axes, np.concatenate(shown))
    axes.set(
        xlabel="x [m]",
        ylabel="y [m]",
        title=f"{Path(run.config.data).name}, {run.team.used} detections used, seed {run.seed}; "
        "wide: the truth",
    )
    axes.get_figure().legend(loc="outside lower left", ncols=6, frameon=False)  # type: ignore[union-attr]


def _draw_error(axes: "Axes", name: str, member: Member, color: str) -> None:
    """The error, what the filter takes it for, and the moments of messages."""
    found = member.history.trajectory
    assert found.covariances is not None
    sigma = np.sqrt(found.covariances[:, 0, 0] + found.covariances[:, 1, 1])
    axes.plot(found.t, np.maximum(sigma, LEAST), color="0.6", lw=1.0, label="σ of the filter")
    errors = _errors(found, member.truth)
    if errors is not None:
        off = np.maximum(errors.position, LEAST)
        axes.plot(errors.t, off, color=color, lw=1.2, label="error against the truth")
    axes.axhline(LIMIT, color=LOST, lw=0.8, ls="--")
    told = [t for t in member.told if found.t[0] <= t <= found.t[-1]]
    axes.plot(
        told,
        np.zeros(len(told)),
        "|",
        color="k",
        ms=7,
        transform=axes.get_xaxis_transform(),
        clip_on=False,
        label="told where it is",
    )
    axes.set_ylabel(f"robot {name} [m]")
    logarithmic(axes, "{:g}")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.95), ncols=3, frameon=False, fontsize=8)


def _errors(found: Trajectory, truth: Trajectory | None) -> PoseErrors | None:
    """None without a truth that the robot meets."""
    try:
        return None if truth is None else pose_errors(found, truth)
    except TruthError:
        return None
