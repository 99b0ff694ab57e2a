"""How well the default configuration does on recorded logs: tracking, global, kidnapped.

    MCLOC_DATA=… python benchmarks/real_logs.py [--jobs 2] [--out docs/results/real_logs.md]

Runs the very job of `mcloc run` with nothing set but start, seed and, for the kidnapping, recovery.
Success rates carry exact (Clopper–Pearson) intervals; a run that fails counts as not converged.
"""

import argparse
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from mcloc import __version__
from mcloc.config import RunConfig
from mcloc.io.tum import read_trajectory
from mcloc.report import Run, accuracy_of, summarize

DATA = Path(os.environ.get("MCLOC_DATA", "data"))
TRACKING_SEEDS, GLOBAL_STARTS, GLOBAL_SEEDS, KIDNAPPED_SEEDS = 10, 10, 4, 20
LEAST_LEFT = 15.0  # m of reference path that a global start leaves


@dataclass(frozen=True)
class Recording:
    """A log with its map and reference, relative to MCLOC_DATA."""

    name: str
    map: str
    log: str
    truth: str

    def config(self, **settings: object) -> RunConfig:
        paths = {k: str(DATA / getattr(self, k)) for k in ("map", "log", "truth")}
        return RunConfig(**paths, threads=1, **settings)  # type: ignore[arg-type]


def _wean(log: str) -> Recording:
    return Recording(log, "wean/wean.dat.gz", f"wean/{log}.log.gz", f"wean/{log}.ref.csv")


def _mapped(name: str) -> Recording:
    log = f"{name}/{name}_test0"
    return Recording(name, f"{name}/{name}_train.yaml", f"{log}.log.gz", f"{log}.ref.csv")


RECORDINGS = (
    _wean("robotdata1"),
    _wean("robotdata3"),
    _wean("robotdata4"),
    Recording("malaga", "malaga/map.yaml", "malaga/scans.log.gz", "malaga/ref.csv"),
    _mapped("intel"),
    _mapped("fhw"),
    _mapped("freiburg-079"),
)


@dataclass(frozen=True)
class Job:
    """One run."""

    study: str
    recording: Recording
    settings: dict[str, object] = field(default_factory=dict)

    def __call__(self) -> dict[str, object]:
        run = Run(self.recording.config(**self.settings))
        for _ in run:
            pass
        return summarize(run, accuracy_of(run))


def jobs() -> Iterator[Job]:
    """Every run of the three studies."""
    for recording in RECORDINGS:
        truth = read_trajectory(DATA / recording.truth)
        start = {"start": truth.t[0] - 1e-3, "initial": tuple(map(float, truth.poses[0]))}
        for seed in range(TRACKING_SEEDS):
            yield Job("tracking", recording, {**start, "seed": seed})
        driven = np.hypot(*np.diff(truth.poses[:, :2], axis=0).T)
        left = driven.sum() - np.concatenate([[0.0], np.cumsum(driven)])
        last = np.flatnonzero(left >= LEAST_LEFT)[-1]
        for t in truth.t[np.linspace(0, last, GLOBAL_STARTS).astype(int)]:
            for seed in range(GLOBAL_SEEDS):
                yield Job("global", recording, {"start": t - 1e-3, "seed": 100 + seed})
    kidnapped = _wean("robotdata_1then4")
    truth = read_trajectory(DATA / kidnapped.truth)
    for recovery in ("none", "random", "augmented"):
        for seed in range(KIDNAPPED_SEEDS):
            start = {"start": truth.t[0] - 1e-3, "initial": tuple(map(float, truth.poses[0]))}
            yield Job("kidnapped", kidnapped, {**start, "recovery": recovery, "seed": seed})


def rate(successes: int, n: int) -> str:
    """k/n with its exact 95 % interval."""
    low, high = binomtest(successes, n).proportion_ci(method="exact")
    return f"{successes}/{n} ({100 * low:.0f}–{100 * high:.0f} %)"


def spread(values: list[float], digits: int) -> str:
    """median (smallest–largest)."""
    if not values:
        return "–"
    return f"{np.median(values):.{digits}f} ({min(values):.{digits}f}–{max(values):.{digits}f})"


def tables(done: list[tuple[Job, dict]]) -> Iterator[str]:
    """The report, line by line."""

    def of(study: str, **match: object) -> list[dict]:
        return [
            summary
            for job, summary in done
            if job.study == study
            and all(getattr(job.recording, k, job.settings.get(k)) == v for k, v in match.items())
        ]

    yield "## Tracking from the reference start (σ 0.5 m, 15°)\n"
    yield f"{TRACKING_SEEDS} seeds; median (smallest–largest) over the seeds.\n"
    yield (
        "| log | position median, m | RMSE, m | worst error, m | heading median, ° "
        "| NEES median | runs ever > 1 m off | real time × |"
    )
    yield "|---|---|---|---|---|---|---|---|"
    for r in RECORDINGS:
        s = of("tracking", name=r.name)
        a = [x["accuracy"] for x in s]
        yield (
            f"| {r.name} | {spread([x['position_median_m'] for x in a], 3)} "
            f"| {spread([x['position_rmse_m'] for x in a], 3)} "
            f"| {max(x['position_max_m'] for x in a):.2f} "
            f"| {spread([x['heading_median_deg'] for x in a], 2)} "
            f"| {spread([x['nees_median'] for x in a if x['nees_median'] is not None], 1)} "
            f"| {rate(sum(x['position_max_m'] > 1.0 for x in a), len(a))} "
            f"| {np.median([x['realtime_factor'] for x in s]):.0f} |"
        )
    yield "\n## Global localization\n"
    yield f"{GLOBAL_STARTS} start times with ≥ {LEAST_LEFT:g} m left × {GLOBAL_SEEDS} seeds.\n"
    yield "| log | converged | distance until then, m: 25 / 50 / 75 / 90 / 100 % | by start time |"
    yield "|---|---|---|---|"
    for r in RECORDINGS:
        a = [x["accuracy"] for x in of("global", name=r.name)]
        d = [x["distance_to_converge_m"] for x in a if x["converged"]]
        quantiles = " / ".join(f"{q:.1f}" for q in np.quantile(d, [0.25, 0.5, 0.75, 0.9, 1.0]))
        starts = [
            sum(x["converged"] for x in a[i : i + GLOBAL_SEEDS])
            for i in range(0, len(a), GLOBAL_SEEDS)
        ]
        yield (
            f"| {r.name} | {rate(len(d), len(a))} | {quantiles} | {' '.join(map(str, starts))} |"
        )
    yield "\n## Kidnapping (robotdata_1then4)\n"
    yield f"Tracking until the robot is carried off; {KIDNAPPED_SEEDS} seeds.\n"
    yield "| recovery | recovered | after, m | after, s |"
    yield "|---|---|---|---|"
    for recovery in ("none", "random", "augmented"):
        found = [x["accuracy"]["recoveries"] for x in of("kidnapped", recovery=recovery)]
        ok = [one[-1] for one in found if one and one[-1]["recovered"]]
        yield (
            f"| {recovery} | {rate(len(ok), len(found))} "
            f"| {spread([x['after_m'] for x in ok], 1)} | {spread([x['after_s'] for x in ok], 1)} |"
        )


def _run(job: Job) -> dict:
    return job()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--out", type=Path, default=Path("docs/results/real_logs.md"))
    arguments = parser.parse_args()
    todo = list(jobs())
    done = []
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for job, summary in zip(todo, pool.map(_run, todo), strict=True):
            done.append((job, summary))
            print(f"\r{len(done)}/{len(todo)} {job.study} {job.recording.name}   ", end="")
    head = (
        f"# Real logs\n\nMeasured with mcloc {__version__}, default configuration, by\n\n"
        "    MCLOC_DATA=… python benchmarks/real_logs.py\n\n"
        "Seeds are fixed: the same command gives the same tables, but for the speed.\n"
    )
    arguments.out.write_text(head + "\n" + "\n".join(tables(done)) + "\n")


if __name__ == "__main__":
    main()
