"""The filters beside each other on recorded logs: tracking, global starts, kidnappings.

    MCLOC_DATA=… python benchmarks/filters.py [--seeds 1] [--starts 3] [--jobs 2] [--rows FILE]
        [--out FILE]

Each run is that of `mcloc run --filter NAME`, as in real_logs.py. Rows of single runs are kept in a
file: a benchmark that was cut goes on from there. Rows in a file are of one version of mcloc:
remove it after a change.
"""

import argparse
import json
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from real_logs import DATA, KIDNAPPED, LEAST_LEFT, RECORDINGS, TELEPORTED, Job, from_true_start
from real_logs_tables import WITHIN, names, of, rate, survival_of

from mcloc import __version__
from mcloc.errors import LogError
from mcloc.io.tum import read_trajectory

NAMES = (
    *("mixture", "mcl", "hierarchical", "markov-grid", "octree", "grid-proposal"),
    *("kalman", "topological"),
)
TRACKING_ONLY = ("kalman",)
CONVERGED = "converged"

Rows = list[dict[str, Any]]


@dataclass(frozen=True)
class Attempt:
    """A run, which may end without any pose."""

    job: Job

    @property
    def key(self) -> str:
        return self.job.key

    def __call__(self) -> dict[str, Any]:
        try:
            return self.job()
        except LogError as nothing:
            named = {"study": self.job.study, "log": self.job.recording.name}
            return {**named, "method": self.job.method, "nothing": str(nothing)}


def attempts(seeds: int, starts: int) -> Iterator[Attempt]:
    """Every run."""
    for recording in RECORDINGS:
        truth = read_trajectory(DATA / recording.truth)
        driven = np.hypot(*np.diff(truth.poses[:, :2], axis=0).T)
        left = driven.sum() - np.concatenate([[0.0], np.cumsum(driven)])
        last = np.flatnonzero(left >= LEAST_LEFT)[-1]
        for name in NAMES:
            chosen = {"filter": name}
            for seed in range(seeds):
                entries = {**from_true_start(truth), **chosen}
                yield Attempt(Job("tracking", recording, name, seed, entries))
            if name in TRACKING_ONLY:
                continue
            for t in truth.t[np.linspace(0, last, starts).astype(int)]:
                yield Attempt(Job("global", recording, name, 100, {"start": t - 1e-3, **chosen}))
    for recording in (KIDNAPPED, *TELEPORTED):
        truth = read_trajectory(DATA / recording.truth)
        for name in NAMES:
            for seed in range(seeds):
                entries = {**from_true_start(truth), "filter": name}
                yield Attempt(Job("kidnapped", recording, name, seed, entries))


def tables(rows: Rows) -> Iterator[str]:
    """The report, line by line."""
    yield "Median error over the runs, m; in brackets the share of the time with more than 1 m.\n"
    logs = names(rows, "log")
    tracked = [log for log in logs if of(rows, study="tracking", log=log)]
    yield "| tracking | " + " | ".join(tracked) + " |"
    yield "|---" * (1 + len(tracked)) + "|"
    for name in NAMES:
        cells = [_accuracy(of(rows, study="tracking", log=log, method=name)) for log in tracked]
        yield f"| {name} | " + " | ".join(cells) + " |"
    yield "\nA robot that may be anywhere: runs that converged; and robots carried off that were"
    yield f"found again within {WITHIN:g} m, by Kaplan and Meier's estimate.\n"
    yield "| | global starts | found again | median update, ms: least and most of the logs |"
    yield "|---|---|---|---|"
    for name in NAMES:
        started = of(rows, study="global", method=name)
        converged = sum(_found(row) for row in started)
        share = rate(converged, len(started)) if started else "–"
        again = _again(of(rows, study="kidnapped", method=name))
        took = [
            float(np.median([row["update_ms"] for row in chosen]))
            for log in tracked
            if (chosen := _ran(of(rows, study="tracking", log=log, method=name)))
        ]
        yield f"| {name} | {share} | {again} | {min(took):.1f} to {max(took):.1f} |"


def _ran(rows: Rows) -> Rows:
    return [row for row in rows if "nothing" not in row]


def _accuracy(rows: Rows) -> str:
    done = _ran(rows)
    if not done:
        return "–"
    medians = [row["accuracy"]["position_median_m"] for row in done]
    lost = np.mean([row["accuracy"]["lost_fraction"]["1"] for row in done])
    return f"{np.median(medians):.2f} ({100 * lost:.1f} %)"


def _found(row: dict[str, Any]) -> bool:
    return "nothing" not in row and bool(row["accuracy"][CONVERGED])


def _again(rows: Rows) -> str:
    stretches = [stretch for row in _ran(rows) for stretch in row["found"]]
    if not stretches:
        return "–"
    within = survival_of(stretches).within(WITHIN)
    return f"{100 * within.value:.0f} % ({100 * within.low:.0f}–{100 * within.high:.0f} %)"


def _run(attempt: Attempt) -> dict[str, Any]:
    return attempt()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1, help="runs of each log that is tracked")
    parser.add_argument("--starts", type=int, default=3, help="moments from which one searches")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--rows", type=Path, default=Path("filters.jsonl"), help="of each run")
    parser.add_argument("--out", type=Path, default=Path("docs/results/filters.md"))
    arguments = parser.parse_args()
    kept = arguments.rows.read_text().splitlines() if arguments.rows.exists() else []
    whole = [line for line in kept if line.endswith("}")]  # the last one may have been cut
    rows = {row.pop("key"): row for row in map(json.loads, whole)}
    everything = list(attempts(arguments.seeds, arguments.starts))
    todo = [attempt for attempt in everything if attempt.key not in rows]
    with ProcessPoolExecutor(arguments.jobs) as pool, arguments.rows.open("a") as file:
        running = {pool.submit(_run, attempt): attempt for attempt in todo}
        for done, future in enumerate(as_completed(running), 1):
            key = running[future].key
            rows[key] = future.result()
            file.write("\n" + json.dumps({"key": key, **rows[key]}))
            file.flush()
            print(f"\r{done}/{len(todo)} {key}          ", end="", flush=True)
    head = f"# Filters\n\nMeasured with mcloc {__version__} and the defaults of each filter, by\n\n"
    command = "    MCLOC_DATA=… python benchmarks/filters.py\n\n"
    text = head + command + "\n".join(tables([rows[a.key] for a in everything])) + "\n"
    arguments.out.write_text(text)


if __name__ == "__main__":
    main()
