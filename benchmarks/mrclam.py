"""How well robots that see landmarks are localized: UTIAS MRCLAM 6, five robots, 15 landmarks.

    python benchmarks/mrclam.py DATA [--seeds 10] [--jobs 2] [--out docs/results/mrclam.md]

DATA: the folder that has mrclam6.
"""

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mcloc import __version__
from mcloc.config import RunConfig
from mcloc.evaluation import Accuracy, evaluate
from mcloc.events import Odometry, Sightings
from mcloc.geometry import between, compose
from mcloc.io.log import read_log
from mcloc.io.mrclam import Mrclam, robots_in
from mcloc.kernels.jit import set_threads
from mcloc.report import Run, accuracy_of
from mcloc.trajectory import Trajectory

WHEELS, EKF = "dead reckoning, true start", "EKF, true start"
GLOBAL = {"mcl": "MCL, from anywhere", "mixture": "mixture MCL, from anywhere"}
SIGMA = (0.05, 0.05, 0.02)  # m, m, rad: how well the true start is told
NEAR, FAR = 0.15, 1.0  # m


@dataclass(frozen=True)
class Job:
    """One robot, localized in one way. filter: none for dead reckoning."""

    folder: str
    robot: int
    filter: str | None
    seed: int

    def __call__(self) -> Accuracy:
        set_threads(1)
        if self.filter is None:
            return self._by_wheels()
        start = None if self.filter in GLOBAL else tuple(self._start()[1].tolist())
        run = Run(
            RunConfig(
                None,
                self.folder,
                robot=self.robot,
                filter=self.filter,
                initial=start,
                initial_sigma=SIGMA,
                seed=self.seed,
            )
        )
        for _ in run:
            pass
        found = accuracy_of(run)
        assert found is not None
        return found

    def _by_wheels(self) -> Accuracy:
        """From the first sighting to the last one, as the filters."""
        events = list(read_log(self.folder, robot=self.robot))
        first, start = self._start()
        seen = np.array([e.t for e in events if isinstance(e, Sightings)])
        rows = np.array([(e.t, *e.pose) for e in events if isinstance(e, Odometry)])
        driven = Trajectory(rows[:, 0], rows[:, 1:])
        t = np.concatenate([[first], rows[(rows[:, 0] > first) & (rows[:, 0] <= seen[-1]), 0]])
        poses = driven.at(t)
        truth = Mrclam(self.folder, self.robot).truth
        assert truth is not None
        believed = Trajectory(t, compose(start, between(poses[0], poses)))
        return evaluate(believed, truth, sightings=seen)

    def _start(self) -> tuple[float, np.ndarray]:
        """When the first landmark is seen, and the true pose then."""
        events = read_log(self.folder, robot=self.robot)
        first = next(e.t for e in events if isinstance(e, Sightings))
        truth = Mrclam(self.folder, self.robot).truth
        assert truth is not None
        return first, truth.at(np.array([first]))[0]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--out", type=Path, default=Path("docs/results/mrclam.md"))
    arguments = parser.parse_args()
    folder = str(arguments.data / "mrclam6")
    ways: dict[str, tuple[str | None, int]] = {
        WHEELS: (None, 1),
        EKF: ("kalman", 1),
        **{name: (filter, arguments.seeds) for filter, name in GLOBAL.items()},
    }
    jobs = {
        (robot, name, seed): Job(folder, robot, filter, seed)
        for robot in robots_in(folder)
        for name, (filter, seeds) in ways.items()
        for seed in range(seeds)
    }
    with ProcessPoolExecutor(arguments.jobs) as pool:
        done = dict(zip(jobs, pool.map(Job.__call__, jobs.values()), strict=True))
    lines = [
        f"# Landmarks\n\nMeasured with mcloc {__version__} by\n\n    python benchmarks/mrclam.py "
        f"DATA --seeds {arguments.seeds}\n",
        "UTIAS MRCLAM 6: five robots drive 43 … 58 m in 15 minutes and see 15 landmarks by their "
        "barcodes, with range and bearing, at times none for more than a minute. Truth is by "
        "motion capture. All parameters are the defaults; ranges and bearings to other robots are "
        "not used.\n",
        f"Median (smallest–largest) of {arguments.seeds} seeds. *sighted*: the median position "
        "error over the references within 5 s of a sighting of a landmark; *median*: over all of "
        f"them, also where the wheels alone carry the robot along; *> {FAR:g} m*: share of the "
        "time. All are from the first sighting on: a filter that starts from anywhere may take "
        "some more of them until it knows the place. The true start of the others is that of the "
        f"first sighting, told to {SIGMA[0]:g} m and {SIGMA[2]:g} rad.\n",
        f"| robot | way | sighted, m | median, m | 95 %, m | > {FAR:g} m | seeds with sighted "
        f"≤ {NEAR:g} m |",
        "|---|---|---|---|---|---|---|",
    ]
    for robot in robots_in(folder):
        for name, (_, seeds) in ways.items():
            found = [done[robot, name, seed] for seed in range(seeds)]
            sighted = [float(a.position_median_sighted_m or np.nan) for a in found]
            cells = [
                _cell(sighted, 3),
                _cell([a.position_median_m for a in found], 3),
                _cell([a.position_p95_m for a in found], 2),
                _cell([100.0 * a.lost_fraction["1"] for a in found], 1) + " %",
                f"{sum(s <= NEAR for s in sighted)}/{seeds}",
            ]
            lines.append(f"| {robot} | {name} | " + " | ".join(cells) + " |")
    arguments.out.write_text("\n".join([*lines, ""]), encoding="utf-8")


def _cell(values: list[float], digits: int) -> str:
    told = f"{np.median(values):.{digits}f}"
    if len(values) > 1:
        told += f" ({min(values):.{digits}f}–{max(values):.{digits}f})"
    return told


if __name__ == "__main__":
    main()
