"""What filters for people recognise in a crowd, and what that does for tracking.

    python benchmarks/people.py [--seeds 10] [--people 40] [--jobs 2] [--out docs/results/people.md]

A robot that knows its start drives 30 m through an office floor, visitors around it. A reading is a
person's if it is more than 0.1 m (five deviations of the laser) shorter than the walls are away.
"""

import argparse
import itertools
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mcloc import Localizer, __version__
from mcloc.events import Scan
from mcloc.filters.catalog import Composition
from mcloc.geometry import compose
from mcloc.kernels.jit import set_threads
from mcloc.protocols import PeopleFilter, Predictive
from mcloc.simulation import office_world
from mcloc.simulation.drive import Scenario, SimulatedDrive, simulate
from mcloc.simulation.ranges import ranges

SENSORS = ("likelihood-field", "beam-four-part")
FILTERS = ("none", "distance", "entropy")
LENGTH, VISITORS = 30.0, 0.7  # m; share of the people
LOST = 1.0  # m


class Watched:
    """A filter for people whose decisions are counted: people and others left out, all people."""

    def __init__(self, inner: PeopleFilter, drive: SimulatedDrive) -> None:
        self.inner, self.drive = inner, drive
        self.right = self.wrong = self.people = self.returns = 0

    def without_people(self, z: Scan, predictive: Predictive) -> tuple[Scan, float]:
        cleaned, share = self.inner.without_people(z, predictive)
        sensor = compose(self.drive.truth.at(np.array([z.t])), z.mount)
        walls = ranges(self.drive.grid, sensor, z.angles, z.range_max)[0]
        person = z.returned & (z.ranges < walls - 0.1)
        gone = z.returned & np.isnan(cleaned.ranges)
        self.right += int((gone & person).sum())
        self.wrong += int((gone & ~person).sum())
        self.people += int(person.sum())
        self.returns += int(z.returned.sum())
        return cleaned, share


@dataclass(frozen=True)
class Job:
    """One drive, tracked in one way."""

    seed: int
    sensor: str
    people: str
    number: int

    def __call__(self) -> dict[str, float]:
        set_threads(1)
        scenario = Scenario(length=LENGTH, people=self.number, visitors=VISITORS)
        drive = simulate(office_world(self.seed), self.seed, scenario)
        start = drive.truth.at(np.zeros(1))[0]
        composition = Composition("mcl", sensor=self.sensor, people=self.people)
        localizer = Localizer(drive.grid, composition, seed=self.seed, initial=start)
        watched = Watched(localizer.filter.people, drive)
        localizer.filter = replace(localizer.filter, people=watched)
        errors = [
            np.hypot(*(estimate.pose - drive.truth.at(np.array([estimate.t]))[0])[:2])
            for estimate in localizer.run(drive.events)
            if estimate.updated
        ]
        return {
            "crowded": watched.people / watched.returns,
            "precision": watched.right / max(watched.right + watched.wrong, 1),
            "recall": watched.right / watched.people,
            "median": float(np.median(errors)),
            "worst": float(np.max(errors)),
            "lost": float(np.mean(np.array(errors) > LOST)),
        }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--people", type=int, default=40)
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--out", type=Path, default=Path("docs/results/people.md"))
    arguments = parser.parse_args()
    ways = list(itertools.product(SENSORS, FILTERS))
    jobs = [Job(s, *way, arguments.people) for way in ways for s in range(arguments.seeds)]
    with ProcessPoolExecutor(arguments.jobs) as pool:
        done = dict(zip(jobs, pool.map(Job.__call__, jobs), strict=True))
    lines = [
        f"# People\n\nMeasured with mcloc {__version__} by\n\n    python benchmarks/people.py\n",
        f"{arguments.seeds} office floors, one drive of {LENGTH:g} m on each among "
        f"{arguments.people} people. Median (smallest–largest) over the drives; *lost*: mean share "
        f"of the updates more than {LOST:g} m off; *better than none*: drives with a smaller "
        "median error.\n",
        "| sensor | people filter | precision | recall | median error, m | worst error, m | lost "
        "| better than none |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for sensor, people in ways:
        found = {
            job.seed: x for job, x in done.items() if (job.sensor, job.people) == (sensor, people)
        }
        plain = {
            job.seed: x for job, x in done.items() if (job.sensor, job.people) == (sensor, "none")
        }
        cells = [
            f"{np.median(v):.3f} ({min(v):.3f}–{max(v):.3f})"
            for v in (
                [x[k] for x in found.values()] for k in ("precision", "recall", "median", "worst")
            )
        ]
        if people == "none":
            cells[:2] = "–", "–"
        lost = np.mean([x["lost"] for x in found.values()])
        better = sum(x["median"] < plain[seed]["median"] for seed, x in found.items())
        cells += [f"{100 * lost:.1f} %", "–" if people == "none" else f"{better}/{len(found)}"]
        lines.append(f"| {sensor} | {people} | " + " | ".join(cells) + " |")
    arguments.out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
