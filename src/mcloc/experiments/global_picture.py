"""E3's picture: the three stages of one run, and the places and their shares in all of them."""

from typing import TYPE_CHECKING

import numpy as np

from mcloc.experiments.global_runs import (
    AS_IN_PAPER,
    LATER,
    LOOKS,
    OFTEN,
    SOON,
    SYMMETRIC,
    changes,
    looks,
    settings,
    share,
    started,
)
from mcloc.experiments.look import places
from mcloc.experiments.table import Row, Setting, Table
from mcloc.geometry import Pose, compose
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.particles import Particles
from mcloc.report.picture import BELIEVED, LOST, TRUE, draw_grid

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_DRAWN = 3000  # particles
MOST_TOLD = 3  # places
KINDS = ("C5", "C6", "C7", "C8", "C9", "k")  # colours; those of places are C0 to C4
MARGIN = 1.0  # m of map around the free floor


def draw(table: Table, figure: "Figure") -> None:
    """The three stages of one run, how the places and their shares change, and how often the true
    one is found.
    """
    cells = figure.add_gridspec(2, 6, height_ratios=(1.0, 1.15))
    setting, seed = typical_run(table)
    driven, first = started(setting, seed)
    at = [LOOKS.index(metres) for metres in (0.0, SOON, LATER)]
    for k, (particles, found, truth) in enumerate(looks(driven, first, setting, seed)):
        if k in at:
            stage = at.index(k)
            axes = figure.add_subplot(cells[0, 2 * stage : 2 * stage + 2])
            _draw_belief(axes, driven.grid, particles, truth)
            when = f"after {LOOKS[k]:g} m" if k else f"{setting['place']}, {setting['sensor']}"
            said = _told([place.share for place in places(found)])
            axes.set_title(f"{when}\n{said if k else f'at first: {said}'}", fontsize="medium")
    number, belief, often = (figure.add_subplot(cells[1, 2 * k : 2 * k + 2]) for k in range(3))
    _draw_way(number, belief, table)
    _draw_often(often, table)
    figure.legend(loc="outside lower center", ncols=5, frameon=False, fontsize="small")


def typical_run(table: Table) -> tuple[Setting, int]:
    """One with sonars that went as in the paper, first to two places and then to the true one, or
    nearly so.
    """
    rows = [
        row
        for row in table.rows
        if row.record and row.setting["place"] != SYMMETRIC and not changes(row.setting)
    ]

    def likeness(row: Row) -> tuple[bool, ...]:
        record = row.record or {}
        two = record["few_1"] and record["places_1"] == 2
        return record["found_3"], two, record["few_1"]

    best = max(rows, key=likeness)
    return best.setting, best.seed


def _told(shares: list[float]) -> str:
    """How many places, and the largest ones' shares."""
    if not shares:
        return "no place"
    largest = ", ".join(f"{100.0 * part:.0f}" for part in shares[:MOST_TOLD])
    more = ", …" if len(shares) > MOST_TOLD else ""
    return f"{len(shares)} place{'s' * (len(shares) > 1)}: {largest}{more} %"


def _draw_belief(axes: "Axes", grid: OccupancyGrid, particles: Particles, truth: Pose) -> None:
    """The samples, and a ring around the truth."""
    draw_grid(axes, grid)
    x, y = particles.states[:2, :: -(-len(particles) // MOST_DRAWN)]
    axes.plot(x, y, ".", color=BELIEVED, ms=1.5)
    axes.plot(*truth[:2], "o", color=TRUE, ms=14, mfc="none", mew=2.0)
    rows, columns = np.nonzero(grid.free)
    ends = np.array([[columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]])
    corners = compose(grid.origin, np.insert(ends * grid.resolution, 2, 0.0, axis=1))
    axes.set_xlim(corners[0, 0] - MARGIN, corners[1, 0] + MARGIN)
    axes.set_ylim(corners[0, 1] - MARGIN, corners[1, 1] + MARGIN)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")


def _draw_way(number: "Axes", belief: "Axes", table: Table) -> None:
    """How many places there are on the way, and how much of the belief the largest and the true
    one have, means of the runs as in the paper.
    """
    own = [(setting, rows) for setting, rows in settings(table) if not changes(setting)]
    for k, (setting, rows) in enumerate(own):
        means = {
            name: np.mean([record[name] for record in rows.records()], axis=0)
            for name in ("places", "best", "true")
        }
        label = f"{setting['place']}, {setting['sensor']}"
        number.plot(LOOKS, means["places"], color=f"C{k}", lw=1.5, label=label)
        belief.plot(LOOKS, means["true"], color=f"C{k}", lw=1.5)
        belief.plot(LOOKS, means["best"], color=f"C{k}", lw=1.0, ls=":")
    for axes in (number, belief):
        for metres in (SOON, LATER):
            axes.axvline(metres, color="0.8", lw=0.8, zorder=0)
        axes.set(xlabel="driven [m]")
        axes.grid(axis="y", alpha=0.3)
    number.set(ylim=(0.0, None), title="Places (mean)")
    belief.set(ylim=(0.0, 1.02), title="Shares: true place,\nlargest place (dotted)")


def _draw_often(axes: "Axes", table: Table) -> None:
    """In how many runs the place is found after 3 m, with the exact interval."""
    names = list(dict.fromkeys(str(place) for place in table.values("place")))
    kinds = list(dict.fromkeys(", ".join(changes(setting)) for setting, _ in settings(table)))
    for setting, rows in settings(table):
        kind, figure = ", ".join(changes(setting)), share(rows, "found_3")
        k, n = kinds.index(kind), names.index(str(setting["place"]))
        height = n + 0.14 * (k - (len(kinds) - 1) / 2)
        axes.plot([figure.low, figure.high], [height] * 2, color=KINDS[k], lw=1.2)
        axes.plot(figure.value, height, "o", color=KINDS[k], ms=4)
    for k, kind in enumerate(kinds):
        axes.plot([], [], "o-", color=KINDS[k], ms=4, lw=1.2, label=kind or AS_IN_PAPER)
    axes.axvline(OFTEN, color=LOST, lw=0.8, ls="--")
    axes.set_yticks(range(len(names)), [name.replace(" ", "\n") for name in names])
    axes.set(xlim=(0.0, 1.0), ylim=(len(names) - 0.5, -0.5), xlabel="share of the runs")
    axes.set_title("Found after 3 m (95 %)")
    axes.grid(axis="x", alpha=0.3)
