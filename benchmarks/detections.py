"""What it costs that robots see each other: one detection, and a team of ten in real time.

    python benchmarks/detections.py [--out docs/results/detections.md]

Each is measured several times, and the best is told: other work on the machine only adds to it.
"""

import argparse
import os
import statistics
import time
from pathlib import Path

import numpy as np

from mcloc import __version__
from mcloc.events import Detection, Odometry, Scan
from mcloc.filters.catalog import Composition
from mcloc.localizer import Localizer, UpdatePolicy
from mcloc.maps.occupancy import FREE, OccupancyGrid
from mcloc.maps.teammates import Teammates
from mcloc.simulation import Scenario, Spotter, office_world, simulate_team
from mcloc.team.policy import TeamPolicy
from mcloc.team.team import Team

MOST_MS = 5.0  # that a detection may take
ROUNDS = 5


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/results/detections.md"))
    arguments = parser.parse_args()
    took = sorted(detection_ms() for _ in range(ROUNDS))
    speed = sorted(real_time() for _ in range(ROUNDS))
    arguments.out.write_text(
        f"""# What detections cost

Measured with mcloc {__version__} on a machine with {os.cpu_count()} cores by

    python benchmarks/detections.py

The best of {ROUNDS} rounds, and the worst: other work on the machine only adds to it.

- A detection between two robots with 5,000 particles each, both messages made and taken in: median
  {took[0]:.1f} ms, in the worst round {took[-1]:.1f} ms; {MOST_MS:g} ms are wanted.
- Ten simulated robots with lasers at 5 Hz, wheels at 10 Hz and looks for each other at 10 Hz, all
  in one process, after they have found themselves: {speed[-1]:.0f} × real time, in the worst round
  {speed[0]:.0f} ×.
""",
        encoding="utf-8",
    )


def detection_ms(n: int = 200) -> float:
    floor = OccupancyGrid(np.full((160, 160), FREE, dtype=np.int8), 0.1, np.zeros(3))
    composed = Composition("mcl", size="fixed", settings={"size": {"particles": 5000}})
    robots = {
        name: Localizer(
            floor,
            composed,
            aids=(Teammates(),),
            seed=k,
            initial=(7.0 + k, 7.5, 0.0),
            policy=UpdatePolicy(coast=1000.0),
        )
        for k, name in enumerate("ab")
    }
    team, took = Team(robots, policy=TeamPolicy(window=0.0)), []
    for k in range(n):
        for name in "ab":
            team.process(name, Odometry(float(k), np.array([0.01 * (k % 20), 0.0, 0.0])))
        began = time.perf_counter()
        team.process("a", Detection(float(k), "b", 1.1, 0.4))
        took.append(time.perf_counter() - began)
    assert team.used == n
    return 1e3 * statistics.median(took)


def real_time() -> float:
    world = office_world(1)
    drive = simulate_team(world, 1, 10, Scenario(length=20.0), Spotter(period=0.1))
    robots = {
        name: Localizer(
            world, "mixture", aids=(Teammates(),), seed=int(name), initial=path.poses[0]
        )
        for name, path in drive.truth.items()
    }
    team, end = Team(robots), drive.truth["1"].t[-1]
    events, began = drive.merged(), None
    for name, event in events:
        if began is None and event.t > 5.0 and isinstance(event, Scan):
            began, since = time.perf_counter(), event.t
        team.process(name, event)
    assert began is not None
    return float((end - since) / (time.perf_counter() - began))


if __name__ == "__main__":
    main()
