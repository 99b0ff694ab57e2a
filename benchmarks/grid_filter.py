"""How fast and large grid-based localization is, beside the same in plain NumPy, the octree, and
MCL:

    [MCLOC_DATA=…] python benchmarks/grid_filter.py [--threads N] [--localized 40]

On the recorded log of the Intel lab, 41 m × 39 m, or without it on a drive through a simulated
museum of 41 m × 31 m. The first update is that of a robot that may be anywhere; the others, of
which the median is told, come after those that it takes to find itself. The NumPy version shifts,
blurs and weighs all cells each time.
"""

import argparse
import os
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.experiments.places import VARIABLE, Drive, recorded
from mcloc.filters.catalog import Composition
from mcloc.filters.markov_grid import MarkovGridFilter
from mcloc.geometry import compose
from mcloc.kernels.jit import set_threads
from mcloc.localizer import Localizer
from mcloc.motion import MOTIONS
from mcloc.motion.moments import moments_of_move
from mcloc.sensors.likelihood_field import LikelihoodField
from mcloc.simulation import Scenario, museum_world, simulate

CELL, SLICES = 0.2, 90  # m, and 4°
SEARCHING = 30  # updates after which all have found themselves
CARRIED_OFF = 1e-3
PARTICLES = {"size": {"particles": 5000}}


@dataclass(frozen=True)
class PlainGrid:
    """The same belief on a grid that lies still, in NumPy and SciPy."""

    sensor: LikelihoodField
    environment: FreeSpace

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        grid = self.sensor.grid
        height, width = np.ceil(np.array(grid.cells.shape) * grid.resolution / CELL).astype(int)
        return int(height), int(width)

    def poses(self, k: int) -> NDArray[np.float64]:
        """(3, n): the middles of a slice."""
        height, width = self.shape
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        theta = np.full(x.size, 2.0 * np.pi / SLICES * k)
        local = np.stack([CELL * x.ravel(), CELL * y.ravel(), theta], axis=-1)
        return np.ascontiguousarray(compose(self.sensor.grid.origin, local).T)

    def start(self) -> NDArray[np.float32]:
        """(K, H, W): uniform over free cells."""
        free = np.isfinite(self.environment.log_density(self.poses(0))).reshape(self.shape)
        cells = np.tile(free, (SLICES, 1, 1)).astype(np.float32)
        return cells / cells.sum()

    def step(self, cells: NDArray[np.float32], u: Any, z: Any, draws: Draws) -> Any:
        """Shift, blur, weigh, normalize."""
        mean, covariance = moments_of_move(MOTIONS.make("odometry"), u, draws)
        moved = np.empty_like(cells)
        for k in range(SLICES):
            theta = 2.0 * np.pi / SLICES * k
            turn = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
            x, y = turn @ mean[:2] / CELL
            sides = np.sqrt(np.diag(turn @ covariance[:2, :2] @ turn.T)) / CELL
            shifted = ndimage.shift(cells[k], (y, x), order=1)
            moved[k] = ndimage.gaussian_filter(shifted, sides[::-1], mode="constant")
        step = 2.0 * np.pi / SLICES
        moved = ndimage.shift(moved, (mean[2] / step, 0.0, 0.0), order=1, mode="grid-wrap")
        spread = float(np.sqrt(covariance[2, 2])) / step
        moved = ndimage.gaussian_filter1d(moved, spread, axis=0, mode="wrap")
        moved = (1.0 - CARRIED_OFF) * moved + CARRIED_OFF / moved.size
        prior = self.environment.log_prior(self.poses(0)).reshape(self.shape)
        log_p = self.log_likelihood(z) + prior.astype(np.float32)
        moved *= np.exp(log_p - log_p.max())
        return moved / moved.sum()

    def log_likelihood(self, z: Any) -> NDArray[np.float32]:
        """(K, H, W): one look-up for each cell and beam; rows and columns of a slice go apart."""
        table, grid = self.sensor.table, self.sensor.grid
        codes = table.codes.astype(np.float32)
        margin = (codes.shape[0] - grid.cells.shape[0]) // 2
        height, width = self.shape
        total = np.zeros((SLICES, height, width), dtype=np.float32)
        points = self.sensor.endpoints(z)
        for k in range(SLICES):
            theta = 2.0 * np.pi / SLICES * k
            turn = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
            for dx, dy in points @ turn.T:
                x = (CELL * (np.arange(width) + 0.5) + dx) / grid.resolution + margin
                y = (CELL * (np.arange(height) + 0.5) + dy) / grid.resolution + margin
                column = np.clip(x.astype(np.intp), 0, codes.shape[1] - 1)
                row = np.clip(y.astype(np.intp), 0, codes.shape[0] - 1)
                total[k] += codes[np.ix_(row, column)]
        most = table.largest * len(points)
        return (most - np.float32(table.step) * total) * np.float32(self.sensor.tempering(z))

    def best(self, cells: NDArray[np.float32]) -> NDArray[np.float64]:
        """(3,): the middle of the likeliest cell."""
        k, row, column = np.unravel_index(int(cells.argmax()), cells.shape)
        pose: NDArray[np.float64] = self.poses(int(k))[:, row * self.shape[1] + column]
        return pose


class Taken:
    """A filter whose moves and measurements are written down."""

    def __init__(self, taken: Any) -> None:
        self.taken, self.steps = taken, []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.taken, name)

    def step(self, bel: Any, u: Any, z: Any, draws: Draws) -> Any:
        self.steps.append((u, z))
        return self.taken.step(bel, u, z, draws)


def drive() -> tuple[str, Drive]:
    """That of the Intel lab, or a simulated one."""
    if VARIABLE in os.environ:
        return "Intel lab", recorded("intel")
    simulated = simulate(museum_world(4), 4, Scenario(length=60.0))
    return "Simulated museum", Drive(simulated.grid, simulated.events, simulated.truth)


def steps_of(chosen: Drive) -> list[tuple[Any, Any]]:
    """The moves and scans that a localizer gives its filter."""
    localizer = Localizer(chosen.grid, Composition("mcl", size="fixed"), seed=1)
    localizer.filter = taken = Taken(localizer.filter)
    for _ in localizer.run(chosen.events):
        pass
    return taken.steps


@dataclass(frozen=True)
class Row:
    """What was measured: seconds of the first update and of those of a localized robot, MB that
    they take, and how many poses are weighed.
    """

    name: str
    seconds: tuple[float, float]
    megabytes: tuple[float, float]
    weighed: tuple[int, int]


def measured(
    name: str, start: Callable[[], Any], step: Callable[..., Any], steps: Any, searching: int
) -> Row:
    """step: (belief, u, z, draws) -> belief, poses weighed. searching: updates that do not count,
    but for the first.
    """
    bel, took, weighed = start(), [], []
    for k, (u, z) in enumerate(steps, 1):
        began = time.perf_counter()
        bel, poses = step(bel, u, z, Draws(1, k))
        took.append(time.perf_counter() - began)
        weighed.append(poses)
    peaks = []
    for before, (u, z) in ((start(), steps[0]), (bel, steps[-1])):
        tracemalloc.start()
        step(before, u, z, Draws(1, len(steps) + 1))
        peaks.append(tracemalloc.get_traced_memory()[1] / 1e6)
        tracemalloc.stop()
    return Row(
        name,
        (took[0], float(np.median(took[searching:]))),
        (peaks[0], peaks[1]),
        (weighed[0], int(np.median(weighed[searching:]))),
    )


def of_filter(name: str, built: Any, steps: Any) -> Row:
    """With the hypotheses, which a localizer asks for each time."""

    def start() -> Any:
        return built.start(built.environment, Draws(1))

    def step(*given: Any) -> tuple[Any, int]:
        bel, info = built.step(*given)
        built.hypotheses(bel)
        return bel, info.weighed

    for _ in range(2):  # kernels are compiled before the clock runs
        step(start(), *steps[0], Draws(1, 1))
    return measured(name, start, step, steps, SEARCHING)


def of_numpy(plain: PlainGrid, steps: Any) -> Row:
    """A few of the same steps; all take as long."""

    def step(cells: Any, *given: Any) -> tuple[Any, int]:
        return plain.step(cells, *given), cells.size

    few = [steps[0], *steps[SEARCHING : SEARCHING + 3]]
    return measured("the same in NumPy", plain.start, step, few, 1)


def table(rows: list[Row]) -> list[str]:
    """Markdown; the last row is what the others are compared with."""
    head = (
        "",
        "first update, ms",
        "localized, ms",
        "updates/s",
        "NumPy takes",
        "poses weighed",
        "MB",
    )
    lines = [f"| {' | '.join(head)} |", "|---|" + "---:|" * (len(head) - 1)]
    slow = rows[-1].seconds
    for row in rows:
        first, localized = row.seconds
        cells = (
            row.name,
            f"{1e3 * first:,.0f}",
            f"{1e3 * localized:,.1f}",
            f"{1.0 / localized:,.1f}",
            f"{slow[0] / first:.1f}× and {slow[1] / localized:.1f}×",
            "{:,} and {:,}".format(*row.weighed),
            "{:,.0f} and {:,.0f}".format(*row.megabytes),
        )
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def difference(grid: MarkovGridFilter, plain: PlainGrid, first: tuple[Any, Any]) -> float:
    """Metres between what both take for likeliest after the first scan."""
    bel, _ = grid.step(grid.start(grid.environment, Draws(1)), *first, Draws(1, 1))
    ours = bel.particles.states[:, bel.particles.weights.argmax()]
    theirs = plain.best(plain.step(plain.start(), *first, Draws(1, 1)))
    return float(np.hypot(*(ours - theirs)[:2]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--localized", type=int, default=40, help="updates of a localized robot")
    arguments = parser.parse_args()
    set_threads(arguments.threads)
    place, chosen = drive()
    steps = steps_of(chosen)[: SEARCHING + arguments.localized]
    lattice = {"cell": CELL, "headings": SLICES, "carried_off": CARRIED_OFF}
    compositions = {
        "`markov-grid`": Composition("markov-grid", settings={"filter": lattice}),
        "`octree`": Composition("octree"),
        "`mcl`, 5,000 particles": Composition("mcl", size="fixed", settings=PARTICLES),
    }
    built = {name: one.build(chosen.grid) for name, one in compositions.items()}
    plain = PlainGrid(LikelihoodField(chosen.grid), FreeSpace(chosen.grid))
    rows = [of_filter(name, one, steps) for name, one in built.items()]
    rows.append(of_numpy(plain, steps))
    grid: Any = built["`markov-grid`"]
    print(f"{place}, {grid.lattice.size:,} cells of {CELL:g} m and {360 / SLICES:g}°; ", end="")
    print(f"{len(steps)} updates, {arguments.threads} threads; ", end="")
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors.")
    print(f"Grid and NumPy differ by {difference(grid, plain, steps[0]):.2f} m after one scan.\n")
    print("\n".join(table(rows)))


if __name__ == "__main__":
    main()
