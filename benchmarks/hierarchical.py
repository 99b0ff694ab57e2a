"""What an answer costs: the levels of hierarchical MCL on recorded logs, and MCL with as many
particles.

    MCLOC_DATA=… python benchmarks/hierarchical.py [--levels 15] [--out FILE]

Robots are tracked from their true start. After each level of each update the tree is asked for the
smallest region that it knows by then: how long it took from the scan on, how large the region is,
how often the robot is in it, and how probable the tree says that is. MCL has as many particles as
the path down to that level, and its answer is a disc around its best hypothesis.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from real_logs import DATA, RECORDINGS, from_true_start

from mcloc import __version__
from mcloc.draws import Draws
from mcloc.filters.catalog import Composition
from mcloc.filters.hierarchical.belief import HierarchicalBelief
from mcloc.filters.hierarchical.hierarchical_mcl import HierarchicalMCL
from mcloc.io.tum import read_trajectory
from mcloc.localizer import Localizer
from mcloc.report.run import Run

LOGS = ("intel", "robotdata1", "fhw")
SEED = 8
TOLD = (1, 2, 3, 4, 6, 8, 10, 12, 15)


@dataclass
class Level:
    """What was found at a level, over the updates."""

    ms: list[float] = field(default_factory=list)
    weighed: list[int] = field(default_factory=list)
    sides: list[NDArray[np.float64]] = field(default_factory=list)
    holds: list[bool] = field(default_factory=list)
    probability: list[float] = field(default_factory=list)


class Watched:
    """A hierarchy that is asked after each level."""

    def __init__(self, tree: HierarchicalMCL) -> None:
        self.tree = tree
        self.asked: list[tuple[float, int, HierarchicalBelief]] = []

    def step(self, bel, u, z, draws: Draws):  # type: ignore[no-untyped-def]
        """Level by level, with a clock."""
        self.asked = []
        began = time.perf_counter()
        for done, info in self.tree.levels_of(bel, u, z, draws):
            self.asked.append((time.perf_counter() - began, info.weighed, done))
        return done, info

    def __getattr__(self, name: str):  # type: ignore[no-untyped-def]
        return getattr(self.tree, name)


def levels(name: str, count: int) -> tuple[list[Level], float]:
    """What each level of the tree says on a log, and the median error of the whole, m."""
    localizer, events, truth = localizing(name, {"filter": {"levels": count}}, "hierarchical")
    watched = Watched(localizer.filter)  # type: ignore[arg-type]
    localizer.filter = watched  # type: ignore[assignment]
    found = [Level() for _ in range(count)]
    errors = []
    for estimate in localizer.run(events):
        true = truth(estimate.t)
        if not estimate.updated or true is None:
            continue
        errors.append(np.hypot(*(estimate.pose - true)[:2]))
        for level, (took, weighed, bel) in zip(found, watched.asked, strict=False):
            *_, answer = bel.answers()
            level.ms.append(1e3 * took)
            level.weighed.append(weighed)
            level.sides.append(answer.region.sides)
            level.holds.append(bool(answer.region.holds(true[:, None])[0]))
            level.probability.append(answer.probability)
    return found, float(np.median(errors))


def mcl(name: str, particles: int) -> tuple[float, float]:
    """Median time of an update in ms, and median error in m, of MCL with so many particles."""
    settings = {"size": {"particles": particles}}
    localizer, events, truth = localizing(name, settings, "mcl", size="fixed")
    errors, took = [], []
    for estimate in localizer.run(events):
        true = truth(estimate.t)
        if estimate.updated and true is not None:
            errors.append(np.hypot(*(estimate.pose - true)[:2]))
            took.append(1e3 * estimate.update.duration)
    return float(np.median(took)), float(np.median(errors))


def localizing(name: str, settings, kind: str, **parts: str):  # type: ignore[no-untyped-def]
    """A localizer at the true start of a log, the log's events, and the truth at a stamp."""
    recording = next(r for r in RECORDINGS if r.name == name)
    run = Run(recording.config(**from_true_start(read_trajectory(DATA / recording.truth))))
    truth, begun = run.truth, from_true_start(run.truth)
    composition = Composition(filter=kind, settings=settings, **parts)
    localizer = Localizer(run.grid, composition, seed=SEED, initial=begun["initial"])

    def at(t: float) -> NDArray[np.float64] | None:
        k = int(np.argmin(np.abs(truth.t - t)))
        return truth.poses[k] if abs(truth.t[k] - t) < 0.05 else None

    return localizer, (e for e in run.log if e.t >= begun["start"]), at


def tables(count: int) -> Iterator[str]:
    """The report, line by line."""
    for name in LOGS:
        found, error = levels(name, count)
        yield f"\n**{name}**, {len(found[0].ms):,} updates; the whole tree is {error:.3f} m off.\n"
        yield (
            "| halved | region, m × m × ° | ms | particles | robot in it | says | "
            "MCL with as many: ms | error, m |"
        )
        yield "|---:|---|---:|---:|---:|---:|---:|---:|"
        for depth in (d for d in TOLD if d <= count):
            level = found[depth - 1]
            x, y, turn = np.median(level.sides, axis=0)
            weighed = int(np.median(level.weighed))
            took, off = mcl(name, weighed)
            yield (
                f"| {depth} | {x:.1f} × {y:.1f} × {np.rad2deg(turn):.0f} | "
                f"{np.median(level.ms):.2f} | {weighed:,} | {100 * np.mean(level.holds):.1f} % | "
                f"{100 * np.mean(level.probability):.1f} % | {took:.2f} | {off:.3f} |"
            )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--levels", type=int, default=15, help="of the tree")
    parser.add_argument("--out", type=Path, default=Path("docs/results/hierarchical.md"))
    arguments = parser.parse_args()
    about = "\n\n".join(str(__doc__).split("\n\n")[2:]).strip()
    text = (
        "# A hierarchy on recorded logs\n\n"
        f"Measured with mcloc {__version__} and the defaults of `--filter hierarchical` with "
        f"{arguments.levels} levels, by\n\n"
        "    MCLOC_DATA=… python benchmarks/hierarchical.py\n\n"
        f"{about}\n" + "\n".join(tables(arguments.levels)) + "\n"
    )
    arguments.out.write_text(text)


if __name__ == "__main__":
    main()
