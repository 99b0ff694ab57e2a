"""A run as a short GIF: the particles as they gather, the estimate, and the truth beside it."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mcloc.evaluation.kidnapping import find_kidnappings
from mcloc.geometry import Pose, compose
from mcloc.io.recording import thinned
from mcloc.localizer import Estimate
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.report.picture import (
    BELIEVED,
    LOST,
    TRUE,
    UNKNOWN_SHADE,
    broken_at_jumps,
    draw_grid,
)
from mcloc.report.run import Run
from mcloc.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from PIL import Image

FRAMES = 100  # at most; even
DOTS = 500  # at most, of a cloud
SIZE, LEAST = 7.5, 5.0  # inches: the longer side of the map, and the least width
BESIDE = 0.8  # inches above and below it
MARGIN = 0.3  # m around it
DPI = 90
FIRST_MS, FRAME_MS, LAST_MS = 1200, 110, 2500  # ms that frames are shown
SHADES = 9  # from each colour to each other one
BELIEF = "#e8590c"
COLOURS = ("black", "white", BELIEF, BELIEVED, TRUE, LOST)


@dataclass(frozen=True, eq=False, slots=True)
class Snapshot:
    """The belief after an update: stamp (s), pose of the estimate, dots (2, ≤ 500), particles."""

    t: float
    pose: Pose
    dots: NDArray[np.float32]
    n: int


class Snapshots:
    """Beliefs of a run at even steps, at most 100 however long it is.

    When there is no room for one more, every other one is dropped, and from then on only every
    other one is taken.
    """

    def __init__(self) -> None:
        self.kept: list[Snapshot] = []
        self._every, self._seen = 1, 0

    def add(self, estimate: Estimate) -> None:
        """Take note of an estimate if it is an update."""
        if not estimate.updated:
            return
        if self._seen % self._every == 0:
            if len(self.kept) == FRAMES:
                self.kept = self.kept[::2]
                self._every *= 2
            particles = estimate.update.particles
            dots = thinned(particles, DOTS)[:, :2].T.astype(np.float32)
            self.kept.append(Snapshot(estimate.t, estimate.pose, dots, len(particles)))
        self._seen += 1


def animate(run: Run, snapshots: Snapshots, path: Path) -> None:
    """Write a GIF of a run with at least one snapshot."""
    from PIL.Image import Dither

    palette = _palette()
    first, *others = [
        frame.quantize(palette=palette, dither=Dither.NONE)
        for frame in _frames(run, snapshots.kept)
    ]
    durations = [FIRST_MS, *[FRAME_MS] * len(others)]
    durations[-1] = LAST_MS
    first.save(path, format="GIF", save_all=True, append_images=others, duration=durations, loop=0)


def _palette() -> "Image.Image":
    """All colours of the film, so that what stays has the same ones in each frame: the shades
    between each two of them, and the grey of what is unknown.
    """
    from matplotlib.colors import to_rgb
    from PIL import Image

    colours = np.array([to_rgb(c) for c in COLOURS])
    mixed = np.linspace(0.0, 1.0, SHADES)[:, None, None, None]
    shades = (mixed * colours[:, None] + (1.0 - mixed) * colours).reshape(-1, 3)
    shades = np.unique(np.append(shades, np.full((1, 3), UNKNOWN_SHADE), axis=0), axis=0)
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.rint(255.0 * shades).astype(np.uint8).tobytes())
    return palette


def _frames(run: Run, kept: list[Snapshot]) -> Iterator["Image.Image"]:
    """What stays is drawn once, and what moves is drawn upon it."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    low, high = _bounds(run.grid)
    width, height = SIZE * (high - low) / (high - low).max()
    figure = Figure(figsize=(max(width, LEAST), height + BESIDE), dpi=DPI, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)  # matplotlib gives it no types
    axes = figure.add_subplot()
    draw_grid(axes, run.grid)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xticks=(), yticks=())
    scene = _Scene(axes, run)
    figure.legend(loc="outside lower center", ncols=4, frameon=False)
    canvas.draw()
    empty = canvas.copy_from_bbox(figure.bbox)
    for snapshot in kept:
        canvas.restore_region(empty)
        for artist in scene.at(snapshot):
            figure.draw_artist(artist)
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def _bounds(grid: OccupancyGrid) -> NDArray[np.float64]:
    """(2, 2): the lower left and the upper right corner of all that is known of a map."""
    row, column = np.nonzero(~grid.unknown)
    cells = np.stack([column + 0.5, row + 0.5, np.zeros(len(row))], axis=-1)
    cells[:, :2] *= grid.resolution
    places = compose(grid.origin, cells)[:, :2]
    return np.stack([places.min(axis=0) - MARGIN, places.max(axis=0) + MARGIN])


class _Scene:
    """What moves: brought to the moment of a snapshot."""

    def __init__(self, axes: "Axes", run: Run) -> None:
        estimate, truth, wheels = run.history.trajectory, run.truth, run.history.wheels
        self._title = axes.set_title(" ", loc="left", animated=True, family="monospace")
        self._dots = _artist(axes, BELIEF, "belief", marker=".", ms=5.0, mew=0.0, ls="", alpha=0.7)
        self._truth = truth
        self._drives = [] if truth is None else [_Drive(axes, "truth", TRUE, 3.5, truth, wheels)]
        self._drives.append(_Drive(axes, "estimate", BELIEVED, 1.5, estimate, wheels))
        self._jumps = [] if truth is None else _jumps(axes, truth, wheels)

    def at(self, snapshot: Snapshot) -> list["Artist"]:
        """What is to be drawn, from the bottom up."""
        t, pose = snapshot.t, snapshot.pose
        told = f"t = {t:6.1f} s   {snapshot.n:6,d} particles"
        if self._truth is not None and self._truth.t[0] <= t <= self._truth.t[-1]:
            off = np.hypot(*(pose - self._truth.at(np.array([t]))[0])[:2])
            told += f"   error {off:5.2f} m"
        self._title.set_text(told)
        self._dots.set_data(*snapshot.dots)
        jumps = [jump for when, jump in self._jumps if when <= t]
        return [
            *jumps,
            self._dots,
            *(a for drive in self._drives for a in drive.at(t)),
            self._title,
        ]


def _jumps(axes: "Axes", truth: Trajectory, wheels: Trajectory) -> list[tuple[float, "Line2D"]]:
    """From where to where the robot was kidnapped, and when (s)."""
    jumps: list[tuple[float, Line2D]] = []
    for k in find_kidnappings(truth.t, truth.poses, wheels):
        label = "_" if jumps else "kidnapped"
        jump = _artist(axes, LOST, label, lw=1.5, ls=":", marker="X", ms=8.0, markevery=[0])
        jump.set_data(*truth.poses[k.first - 1 : k.first + 1, :2].T)
        jumps.append((k.t, jump))
    return jumps


class _Drive:
    """A path up to the moment, and where its robot is."""

    def __init__(
        self,
        axes: "Axes",
        label: str,
        colour: str,
        width: float,
        path: Trajectory,
        wheels: Trajectory,
    ) -> None:
        self._path, self._wheels = path, wheels
        self._line = _artist(axes, colour, label, lw=width, alpha=0.7)
        self._robot = _artist(axes, colour, "_", ms=9.0 + 2.0 * width, mec="white", mew=0.8)

    def at(self, t: float) -> list["Line2D"]:
        """The path and the robot, a triangle that points ahead."""
        known = self._path.t <= t
        driven = Trajectory(self._path.t[known], self._path.poses[known])
        if not len(driven):
            return []
        self._line.set_data(*broken_at_jumps(driven, self._wheels).T)
        x, y, theta = driven.poses[-1]
        self._robot.set_data([x], [y])
        self._robot.set_marker((3, 0, round(np.degrees(theta)) - 90))
        return [self._line, self._robot]


def _artist(axes: "Axes", colour: str, label: str, **style: Any) -> "Line2D":
    """Something that is drawn frame by frame."""
    (line,) = axes.plot([], [], color=colour, label=label, animated=True, **style)
    return line
