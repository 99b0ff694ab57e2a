"""What robots gain that see each other: UTIAS MRCLAM 6, with landmarks for one robot only and for
all of them.

    python benchmarks/team.py DATA [--seeds 10] [--jobs 2] [--out docs/results/team.md]

DATA: the folder that has mrclam6.
"""

import argparse
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mcloc import __version__
from mcloc.evaluation.errors import pose_errors
from mcloc.evaluation.intervals import Interval, paired_difference
from mcloc.events import Detection
from mcloc.io.mrclam import robots_in
from mcloc.kernels.jit import set_threads
from mcloc.report.team import TeamConfig
from mcloc.report.team_run import TeamRun

NEAR = 0.5  # m
SOON = 10.0  # s after a detection
MARGIN = 0.02  # m that a robot may be worse than alone where all see landmarks
ONE, ALL = "landmarks for robot 1, told start", "landmarks for all, from anywhere"
WAYS: dict[str, tuple[tuple[int, ...] | None, bool]] = {ONE: ((1,), True), ALL: (None, False)}


@dataclass(frozen=True)
class Found:
    """How one robot fared: share of the time within NEAR, median error (m), that of the references
    up to SOON after a detection of it (m), whether or not anybody was told, and the median NEES.
    """

    near: float
    error: float
    soon: float
    nees: float


@dataclass(frozen=True)
class Job:
    """One run of the team."""

    folder: str
    way: str
    detect: bool
    seed: int

    def __call__(self) -> dict[str, Found]:
        set_threads(1)
        landmarks_for, told_start = WAYS[self.way]
        config = TeamConfig(self.folder, landmarks_for, told_start, self.detect, seed=self.seed)
        run = TeamRun(config)
        for _ in run:
            pass
        seen = _seen(self.folder)
        return {name: _found(run, name, seen[name]) for name in run.members}


def _found(run: TeamRun, name: str, seen: np.ndarray) -> Found:
    member = run.members[name]
    assert member.truth is not None
    errors = pose_errors(member.history.trajectory, member.truth)
    last = np.searchsorted(seen, errors.t, side="right") - 1
    soon = (last >= 0) & (errors.t - seen[np.maximum(last, 0)] <= SOON)
    nees = run.summary()["robots"][name]["nees_median"]
    return Found(
        1.0 - errors.lost_fraction(NEAR),
        float(np.median(errors.position)),
        float(np.median(errors.position[soon])),
        float(nees),
    )


def _seen(folder: str) -> dict[str, np.ndarray]:
    """(K,): the stamps of the detections of each robot, as the one that sees or the one seen."""
    stamps: dict[str, list[float]] = {str(robot): [] for robot in robots_in(folder)}
    for member in TeamRun(TeamConfig(folder, seed=0)).members.values():
        for event in member.log.team_events(np.zeros(3), landmarks=False):
            if isinstance(event, Detection) and event.seen in stamps:
                stamps[event.seen].append(event.t)
                stamps[str(member.log.robot)].append(event.t)
    return {name: np.unique(of) for name, of in stamps.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--out", type=Path, default=Path("docs/results/team.md"))
    arguments = parser.parse_args()
    folder = str(arguments.data / "mrclam6")
    jobs = {
        (way, detect, seed): Job(folder, way, detect, seed)
        for way in WAYS
        for detect in (True, False)
        for seed in range(arguments.seeds)
    }
    with ProcessPoolExecutor(arguments.jobs) as pool:
        done = dict(zip(jobs, pool.map(Job.__call__, jobs.values()), strict=True))
    text = "\n".join([*_lines(done, robots_in(folder), arguments.seeds), ""])
    arguments.out.write_text(text, encoding="utf-8")


def _lines(
    done: dict[tuple[str, bool, int], dict[str, Found]], robots: list[int], seeds: int
) -> Iterator[str]:
    yield (
        f"# Teams\n\nMeasured with mcloc {__version__} by\n\n    python benchmarks/team.py DATA "
        f"--seeds {seeds}\n"
    )
    yield (
        "UTIAS MRCLAM 6: five robots drive 43 … 58 m in 15 minutes and see landmarks and each "
        "other by barcodes. Truth is by motion capture. All parameters are the defaults. *Alone* "
        "is the same run without what robots tell each other. Robots without landmarks then have "
        "their wheels alone, from a start that is told to 0.05 m and 0.02 rad.\n"
    )
    yield (
        f"Means of {seeds} seeds, and the mean difference over pairs of runs of one seed with its "
        f"95 % interval (BCa). *near*: share of the time with a position error below {NEAR:g} m; "
        f"*soon*: the median error over the references up to {SOON:g} s after the robot saw "
        "another or was seen; *median*: over all of them; NEES: 2.4 for a filter that is as sure "
        "as it should be.\n"
    )
    for way, (landmarks_for, _) in WAYS.items():
        told = [r for r in robots if landmarks_for is not None and r not in landmarks_for]
        yield f"## {way[0].upper()}{way[1:]}\n"
        yield (
            "| robot | near | alone | difference | soon, m | alone | difference, m | median, m | "
            "alone | difference, m | NEES | alone |"
        )
        yield "|---" * 12 + "|"
        groups = {str(robot): [robot] for robot in robots}
        groups["those told" if told else "all"] = told or robots
        for title, members in groups.items():
            yield f"| {title} | " + " | ".join(_cells(done, way, members, seeds)) + " |"
        yield ""
        yield _verdict(done, way, told, robots, seeds)
        yield ""


def _cells(
    done: dict[tuple[str, bool, int], dict[str, Found]], way: str, members: list[int], seeds: int
) -> Iterator[str]:
    for name, unit, digits in (("near", 100.0, 0), ("soon", 1.0, 3), ("error", 1.0, 3)):
        a, b = (_values(done, way, detect, members, seeds, name) for detect in (True, False))
        share = " %" if unit > 1.0 else ""
        yield f"{unit * a.mean():.{digits}f}{share}"
        yield f"{unit * b.mean():.{digits}f}{share}"
        yield _told(paired_difference(unit * a, unit * b), digits)
    for detect in (True, False):
        yield f"{_values(done, way, detect, members, seeds, 'nees').mean():.1f}"


def _values(
    done: dict[tuple[str, bool, int], dict[str, Found]],
    way: str,
    detect: bool,
    members: list[int],
    seeds: int,
    name: str,
) -> np.ndarray:
    """(seeds,): the mean over the robots."""
    return np.array(
        [
            np.mean([getattr(done[way, detect, seed][str(m)], name) for m in members])
            for seed in range(seeds)
        ]
    )


def _told(found: Interval, digits: int) -> str:
    return f"{found.value:+.{digits}f} ({found.low:+.{digits}f} … {found.high:+.{digits}f})"


def _verdict(
    done: dict[tuple[str, bool, int], dict[str, Found]],
    way: str,
    told: list[int],
    robots: list[int],
    seeds: int,
) -> str:
    if told:
        pairs = [
            [_values(done, way, detect, told, seeds, name) for detect in (True, False)]
            for name in ("near", "soon")
        ]
        near, soon = (paired_difference(*pair) for pair in pairs)
        better = near.low > 0.0 and soon.high < 0.0
        return (
            "Robots without landmarks are better off with sightings, both intervals exclude 0: "
            f"**{'yes' if better else 'no'}**."
        )
    worst = max(
        paired_difference(
            *(_values(done, way, detect, [robot], seeds, "error") for detect in (True, False))
        ).high
        for robot in robots
    )
    return (
        f"No robot is worse than alone by more than {MARGIN:g} m: "
        f"**{'yes' if worst <= MARGIN else 'no'}** (the largest upper end is {worst:+.3f} m)."
    )


if __name__ == "__main__":
    main()
