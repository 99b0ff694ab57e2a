"""A run at a glance: where the robot was, and how well that was known."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import TruthError
from mcloc.evaluation.accuracy import LOST_LIMITS
from mcloc.evaluation.errors import PoseErrors, pose_errors
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.report.beacons import draw_beacons
from mcloc.report.beliefs import draw_belief
from mcloc.report.run import Run
from mcloc.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARGIN = 2.0  # m of map around what happened
JUMP = 1.0  # m that a path moves more than the wheels do: it is not drawn as driven
BELIEVED, TRUE, SPREAD, LOST, SEEN = "#1f5fbf", "#3a9a4b", "0.6", "#c0392b", "#f4c430"
UNKNOWN_SHADE = 0.82


def draw(run: Run, path: Path) -> None:
    """Write a PNG of a run with at least one estimate: the map, its paths, the errors over time."""
    from matplotlib.figure import Figure

    estimate = run.history.trajectory
    errors = _errors(run, estimate)
    figure = Figure(figsize=(15.0, 8.0), layout="constrained")
    cells = figure.add_gridspec(3, 2, width_ratios=(1.7, 1.0), height_ratios=(1.3, 1.0, 1.0))
    _draw_map(figure.add_subplot(cells[:, 0]), run, estimate)
    position = figure.add_subplot(cells[0, 1])
    heading = figure.add_subplot(cells[1, 1], sharex=position)
    _draw_position(position, estimate, errors)
    _draw_heading(heading, estimate, errors)
    _draw_particles(figure.add_subplot(cells[2, 1], sharex=position), run, estimate)
    for axes in (position, heading):
        axes.tick_params(labelbottom=False)
    # Without the name of the library's version the same run gives the same bytes for longer.
    figure.savefig(path, format="png", dpi=110, metadata={"Software": None})


def _errors(run: Run, estimate: Trajectory) -> PoseErrors | None:
    """None without a truth that the run meets; what is wrong with it is said elsewhere."""
    try:
        return None if run.truth is None else pose_errors(estimate, run.truth)
    except TruthError:
        return None


def _draw_map(axes: "Axes", run: Run, estimate: Trajectory) -> None:
    """The map from above with the true and the estimated path and the last particles."""
    draw_grid(axes, run.grid)
    wheels = run.history.wheels
    shown = [estimate.poses[:, :2]]
    if run.truth is not None:
        within = (run.truth.t >= estimate.t[0]) & (run.truth.t <= estimate.t[-1])
        truth = Trajectory(run.truth.t[within], run.truth.poses[within])
        shown.append(truth.poses[:, :2])
        axes.plot(*broken_at_jumps(truth, wheels).T, color=TRUE, lw=3.5, alpha=0.8, label="truth")
    axes.plot(*broken_at_jumps(estimate, wheels).T, color=BELIEVED, lw=1.4, label="estimate")
    start = estimate.poses[0, :2]
    axes.plot(*start, "o", color=BELIEVED, ms=8, mfc="white", label="first estimate")
    if run.localizer.hypotheses:  # none of a filter that withholds its estimate at the end
        x, y, theta = np.array([h.mean for h in run.localizer.hypotheses]).T
        axes.quiver(
            x,
            y,
            np.cos(theta),
            np.sin(theta),
            color=BELIEVED,
            scale=20.0,
            width=0.005,
            zorder=4,
            label="hypotheses at the end",
        )
    draw_belief(axes, run.localizer.belief)
    if run.landmarks is not None:
        shown.append(run.landmarks.places)
        axes.plot(*run.landmarks.places.T, "*", color="k", ms=9, mfc=SEEN, label="landmarks")
    shown += draw_beacons(axes, run)
    zoom(axes, np.concatenate(shown))
    axes.set(xlabel="x [m]", ylabel="y [m]", title=_title(run))
    axes.get_figure().legend(loc="outside lower left", ncols=6, frameon=False)  # type: ignore[union-attr]


def draw_grid(axes: "Axes", grid: OccupancyGrid) -> None:
    """Walls dark, free space white, what is unknown grey; turned as the map's origin says."""
    from matplotlib.transforms import Affine2D

    shade = np.full(grid.cells.shape, UNKNOWN_SHADE)
    shade[grid.free], shade[grid.occupied] = 1.0, 0.15
    height, width = np.array(grid.cells.shape) * grid.resolution
    x, y, yaw = grid.origin
    image = axes.imshow(
        shade, cmap="gray", vmin=0.0, vmax=1.0, origin="lower", extent=(0.0, width, 0.0, height)
    )
    image.set_transform(Affine2D().rotate(yaw).translate(x, y) + axes.transData)
    axes.set_facecolor(f"{UNKNOWN_SHADE}")


def zoom(axes: "Axes", shown: NDArray[np.float64]) -> None:
    """Where the robot was, true or believed, landmarks, and some surroundings."""
    low, high = shown.min(axis=0) - MARGIN, shown.max(axis=0) + MARGIN
    axes.set_aspect("equal", adjustable="datalim")
    # Not fixed, so that one of the two may grow until the map fills its place.
    axes.set_xlim(low[0], high[0], auto=True)
    axes.set_ylim(low[1], high[1], auto=True)


def _draw_position(axes: "Axes", estimate: Trajectory, errors: PoseErrors | None) -> None:
    """The error, what the filter takes it for, and the errors from which a robot counts as lost."""
    assert estimate.covariances is not None
    sigma = np.sqrt(estimate.covariances[:, 0, 0] + estimate.covariances[:, 1, 1])
    axes.plot(estimate.t, np.maximum(sigma, 1e-3), color=SPREAD, lw=1.2, label="σ of the filter")
    if errors is not None:
        found = np.maximum(errors.position, 1e-3)
        axes.plot(errors.t, found, color=BELIEVED, lw=1.2, label="error against the truth")
        limits = [float(limit) for limit in LOST_LIMITS]
        ends = axes.get_xlim()
        axes.hlines(limits, *ends, color=LOST, lw=0.8, ls="--", label="lost")
        axes.set_xlim(ends)
    axes.set(ylabel="position [m]")
    logarithmic(axes, "{:g}")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False)


def _draw_heading(axes: "Axes", estimate: Trajectory, errors: PoseErrors | None) -> None:
    assert estimate.covariances is not None
    sigma = np.degrees(np.sqrt(estimate.covariances[:, 2, 2]))
    axes.plot(estimate.t, np.maximum(sigma, 1e-2), color=SPREAD, lw=1.2)
    if errors is not None:
        found = np.maximum(np.degrees(errors.heading), 1e-2)
        axes.plot(errors.t, found, color=BELIEVED, lw=1.2)
    axes.set(ylabel="heading [°]")
    logarithmic(axes, "{:g}")


def _draw_particles(axes: "Axes", run: Run, estimate: Trajectory) -> None:
    n = run.history.column("n_particles")
    axes.step(estimate.t, n, where="post", color="0.3", lw=1.2)
    axes.set(ylabel="particles, or cells", xlabel="t [s]")
    logarithmic(axes, "{:,.0f}")


def logarithmic(axes: "Axes", numbers: str) -> None:
    """Logarithmic, with plain numbers."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axes.set_yscale("log")
    low, high = axes.get_ylim()
    # A decade holds too few ticks where the curve spans little more.
    subs = (1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,)
    axes.yaxis.set_major_locator(LogLocator(subs=subs))
    axes.yaxis.set_major_formatter(StrMethodFormatter(numbers.replace("{:", "{x:")))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(alpha=0.3)


def broken_at_jumps(path: Trajectory, wheels: Trajectory) -> NDArray[np.float64]:
    """(M, 2): the places of a path, with a gap where it jumps instead of driving."""
    driven = np.linalg.norm(np.diff(wheels.at(path.t)[:, :2], axis=0), axis=1)
    places = path.poses[:, :2]
    jumps = np.linalg.norm(np.diff(places, axis=0), axis=1) > driven + JUMP
    return np.insert(places, np.flatnonzero(jumps) + 1, np.nan, axis=0)


def _title(run: Run) -> str:
    config = run.config
    how = "global localization" if config.initial is None else "from a given pose"
    return f"{Path(config.log).name} on {Path(run.grid.name).name}, {how}, seed {config.seed}"
