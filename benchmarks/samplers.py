"""The pose samplers beside each other, on recorded logs: time, memory, and what the default filter
makes of them.

    MCLOC_DATA=… python benchmarks/samplers.py [--samplers feature-tree,grid-match] [--seeds 1]
        [--scans 100] [--jobs 2] [--rows FILE] [--out FILE]

Densities: `--scans` scans of each log at random moments, on one thread, with nothing else running
that this started. Starts: from each of 10 moments of each log, the robot anywhere. Kidnappings: as
in real_logs.py. Rows of single runs are kept in a file: a benchmark that was cut goes on from
there. Rows in a file are of one version of mcloc: remove it after a change.
"""

import argparse
import json
import os
import time
import tracemalloc
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from real_logs import DATA, KIDNAPPED, LEAST_LEFT, RECORDINGS, STARTS, TELEPORTED, Job, Recording
from real_logs_tables import WITHIN, names, of, rate

from mcloc import __version__
from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.evaluation.survival import Survival
from mcloc.geometry import wrap
from mcloc.io.log import read_log
from mcloc.io.tum import read_trajectory
from mcloc.kernels.jit import set_threads
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.protocols import PoseSampler
from mcloc.samplers import SAMPLERS
from mcloc.sensors.likelihood_field import LikelihoodField
from mcloc.simulation.moments import Recording as Moments

PLACES = tuple(r for r in RECORDINGS if r.name != "malaga")
PARTICLES = 5000  # that the filter draws from each scan
NEAR, TURNED = 0.5, np.deg2rad(10.0)  # m, rad: of the true place


@dataclass(frozen=True)
class Densities:
    """What a sampler makes of scans of a log."""

    recording: Recording
    method: str
    scans: int

    @property
    def key(self) -> str:
        return f"density {self.recording.name} {self.method} {self.scans}"

    def __call__(self) -> dict[str, Any]:
        set_threads(1)
        truth = read_trajectory(DATA / self.recording.truth)
        log = Moments(list(read_log(DATA / self.recording.log)), truth)
        count = len(log.scans)
        moments = np.random.default_rng(11).choice(count, min(self.scans, count), replace=False)
        scans = [log.scan(k) for k in np.sort(moments)]
        grid = OccupancyGrid.load(DATA / self.recording.map)
        model = grid, LikelihoodField(grid), FreeSpace(grid)

        def first_look() -> tuple[PoseSampler, float]:
            made, begun = SAMPLERS.make(self.method, *model), time.perf_counter()
            made.given(scans[0], Draws(1))
            return made, time.perf_counter() - begun

        sampler, _ = first_look()  # compiles
        sampler.given(scans[0], Draws(1)).log_density(np.zeros((3, 1)))
        tracemalloc.start()
        sampler, _ = first_look()
        kept, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        sampler, build = first_look()
        rows = [self._row(sampler, z, truth.at([z.t])[0], k) for k, z in enumerate(scans)]
        given, drawn, near, ess = np.array(rows).T
        return {
            "study": "density",
            "log": self.recording.name,
            "method": self.method,
            "build_s": build - float(np.median(given)),
            "kept_mb": kept / 1e6,
            "peak_mb": most / 1e6,
            "given_ms": 1e3 * float(np.median(given)),
            "drawn_ms": 1e3 * float(np.median(drawn)),
            "near": near.tolist(),
            "ess": ess.tolist(),
        }

    def _row(self, sampler: PoseSampler, z: Any, pose: Any, k: int) -> list[float]:
        """Seconds to look, and to draw and weigh besides; the share of q̄ near the true place; the
        ESS of p(z | x) p(x | m) / q̄, as a share.
        """
        begun = time.perf_counter()
        q = sampler.given(z, Draws(5, k))
        given = time.perf_counter() - begun
        x = q.sample(Draws(7, k), 0, PARTICLES)
        log_q = q.log_density(x)
        drawn = time.perf_counter() - begun
        fit = sampler.sensor.log_likelihood(x, z) + sampler.environment.log_prior(x)
        w = np.exp(fit - log_q - (fit - log_q).max())
        there = np.hypot(x[0] - pose[0], x[1] - pose[1]) <= NEAR
        there &= np.abs(wrap(x[2] - pose[2])) <= TURNED
        return [given, drawn, there.mean(), w.sum() ** 2 / (w**2).sum() / PARTICLES]


def runs(samplers: list[str], seeds: int) -> Iterator[Job]:
    """Every run of the filter."""
    for sampler in samplers:
        parts = {"filter": "mixture", "sampler": sampler}
        for recording in PLACES:
            truth = read_trajectory(DATA / recording.truth)
            driven = np.hypot(*np.diff(truth.poses[:, :2], axis=0).T)
            left = driven.sum() - np.concatenate([[0.0], np.cumsum(driven)])
            last = np.flatnonzero(left >= LEAST_LEFT)[-1]
            for t in truth.t[np.linspace(0, last, STARTS).astype(int)]:
                for seed in range(seeds):
                    yield Job(
                        "global", recording, sampler, 100 + seed, {"start": t - 1e-3, **parts}
                    )
        for recording in (KIDNAPPED, *TELEPORTED):
            truth = read_trajectory(DATA / recording.truth)
            pose = tuple(map(float, truth.poses[0]))
            begun = {"start": truth.t[0] - 1e-3, "initial": pose, **parts}
            for seed in range(5 * seeds):
                yield Job("kidnapped", recording, sampler, seed, begun)


def tables(rows: list[dict[str, Any]]) -> Iterator[str]:
    """The report, line by line."""
    yield "## Densities\n"
    scans = len(rows[0]["near"])
    yield (
        f"{scans} scans of each log, likelihood field, one thread. Built: what the first scan "
        f"takes longer. Drawn: also {PARTICLES} poses drawn, and their density. Near: scans in "
        "which q̄ has so much within 0.5 m and 10° of the true place. ESS: of these poses, weighed "
        "by p(z | x) p(x | m) / q̄; medians.\n"
    )
    yield (
        "| log | sampler | built, s | kept, MB | at most, MB | given, ms | drawn, ms "
        "| near ≥ 10 % | near ≥ 1 % | ESS, % |"
    )
    yield "|---|---|---|---|---|---|---|---|---|---|"
    density = of(rows, study="density")
    for log in names(density, "log"):
        for row in of(density, log=log):
            near = np.array(row["near"])
            yield (
                f"| {log} | {row['method']} | {row['build_s']:.2f} | {row['kept_mb']:.1f} "
                f"| {row['peak_mb']:.0f} | {row['given_ms']:.1f} | {row['drawn_ms']:.1f} "
                f"| {100 * np.mean(near >= 0.1):.0f} % | {100 * np.mean(near >= 0.01):.0f} % "
                f"| {100 * np.median(row['ess']):.1f} |"
            )
    yield "\n## Global localization\n"
    yield (
        "Found: errors below 0.5 m and 10° for 3 m; share within 20 m: 1 − Kaplan–Meier, with its "
        "lower limit. Converged: the same until the end of the log.\n"
    )
    yield from _found(of(rows, study="global"))
    yield "\n## Kidnapping\n"
    yield from _found(of(rows, study="kidnapped"))


def _found(rows: list[dict[str, Any]]) -> Iterator[str]:
    started = rows[0]["study"] == "global"
    yield (
        f"| log | sampler | searches |{' converged |' if started else ''} found within 20 m "
        "| median, m | mean of the first 20 m | time > 2 m off, % | mean update, ms |"
    )
    yield "|---|---|---|---|---|---|---|---|" + ("---|" if started else "")
    for log in [*names(rows, "log"), "all"]:
        for method in names(rows, "method"):
            some = [r for r in of(rows, method=method) if log in ("all", r["log"])]
            stretches = [s for r in some for s in ([r["first"]] if started else r["found"])]
            long = [s for s in stretches if s[0] >= LEAST_LEFT]
            after = np.array([s[1] if s[2] else s[0] for s in long])
            survival = Survival(after, np.array([s[2] for s in long]))
            share, median = survival.within(WITHIN), survival.median
            converged = sum(bool(row["accuracy"]["converged"]) for row in some)
            yield (
                f"| {log} | {method} | {len(long)} "
                f"{f'| {rate(converged, len(some))} ' if started else ''}"
                f"| {100 * share.value:.0f} % (≥ {100 * share.low:.0f} %) "
                f"| {'–' if median is None else f'{median:.1f}'} "
                f"| {survival.restricted_mean(WITHIN):.1f} "
                f"| {100 * np.mean([row['lost'] for row in some]):.1f} "
                f"| {np.median([row['mean_ms'] for row in some]):.1f} |"
            )


def _run(job: Job) -> dict[str, Any]:
    return job()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samplers", default=",".join(SAMPLERS), help="names, with commas")
    parser.add_argument("--seeds", type=int, default=1, help="of each start; 5 times for drives")
    parser.add_argument("--scans", type=int, default=100, help="of each log, for densities")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--rows", type=Path, default=Path("samplers.jsonl"), help="of each run")
    parser.add_argument("--out", type=Path, help="a file for the tables")
    arguments = parser.parse_args()
    samplers = arguments.samplers.split(",")
    kept = arguments.rows.read_text().splitlines() if arguments.rows.exists() else []
    whole = [line for line in kept if line.endswith("}")]  # the last one may have been cut
    rows = {row.pop("key"): row for row in map(json.loads, whole)}
    density = [Densities(place, s, arguments.scans) for place in PLACES for s in samplers]
    searches = list(runs(samplers, arguments.seeds))
    with arguments.rows.open("a") as file:

        def keep(job: Densities | Job, row: dict[str, Any]) -> None:
            rows[job.key] = row
            file.write("\n" + json.dumps({"key": job.key, **row}))
            file.flush()
            print(f"\r{job.key}          ", end="", flush=True)

        for job in density:
            if job.key not in rows:
                keep(job, job())
        with ProcessPoolExecutor(arguments.jobs) as pool:
            todo = [job for job in searches if job.key not in rows]
            running = {pool.submit(_run, job): job for job in todo}
            for future in as_completed(running):
                keep(running[future], future.result())
    command = f"python benchmarks/samplers.py --seeds {arguments.seeds} --scans {arguments.scans}"
    head = (
        f"# Pose samplers\n\nMeasured with mcloc {__version__} by\n\n    MCLOC_DATA=… {command}\n\n"
    )
    text = head + "\n".join(tables([rows[job.key] for job in (*density, *searches)])) + "\n"
    print("\n" + text)
    if arguments.out:
        arguments.out.write_text(text)


if __name__ == "__main__":
    main()
