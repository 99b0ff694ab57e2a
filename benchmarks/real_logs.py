"""How well mcloc does on recorded logs: tracking, global localization, kidnappings.

    MCLOC_DATA=… python benchmarks/real_logs.py [--jobs 2] [--rows FILE] [--out FILE]

Runs the very job of `mcloc run` with nothing set but start, seed and what is compared. Rows of
single runs are kept in a file: a benchmark that was cut goes on from there. Intervals are 95 %:
exact for shares, bootstrapped over seeds for means, Greenwood's for distances until found. Rows in
a file are of one version of mcloc: remove it after a change.
"""

import argparse
import json
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from real_logs_tables import tables

from mcloc import __version__
from mcloc.config import RunConfig, limited
from mcloc.evaluation.convergence import found, recoveries
from mcloc.evaluation.errors import pose_errors, with_withheld
from mcloc.evaluation.kidnapping import find_kidnappings
from mcloc.io.tum import read_trajectory
from mcloc.report import Run, accuracy_of, summarize
from mcloc.simulation.teleports import teleported

DATA = Path(os.environ.get("MCLOC_DATA", "data"))
SEEDS, STARTS, GLOBAL_SEEDS = 20, 10, 4
LEAST_LEFT = 15.0  # m of reference path that a global start leaves
MANY = 20_000  # particles of MCL at a global start, at most
PER_METRE = 0.01  # teleports


@dataclass(frozen=True)
class Recording:
    """A log with its map and reference, relative to MCLOC_DATA."""

    name: str
    map: str
    log: str
    truth: str

    def config(self, **settings: Any) -> RunConfig:
        paths = {k: str(DATA / getattr(self, k)) for k in ("map", "log", "truth")}
        return RunConfig(**{**paths, "threads": 1, **settings})


def _wean(log: str) -> Recording:
    return Recording(log, "wean/wean.dat.gz", f"wean/{log}.log.gz", f"wean/{log}.ref.csv")


def _mapped(name: str) -> Recording:
    log = f"{name}/{name}_test0"
    return Recording(name, f"{name}/{name}_train.yaml", f"{log}.log.gz", f"{log}.ref.csv")


KIDNAPPED = _wean("robotdata_1then4")
TELEPORTED = tuple(map(_mapped, ("intel", "fhw", "freiburg-079")))
RECORDINGS = (
    _wean("robotdata1"),
    _wean("robotdata3"),
    _wean("robotdata4"),
    Recording("malaga", "malaga/map.yaml", "malaga/scans.log.gz", "malaga/ref.csv"),
    *TELEPORTED,
)

METHODS: dict[str, dict[str, Any]] = {
    "mixture": {"filter": "mixture"},
    "augmented MCL": {"filter": "mcl", "recovery": "augmented"},
    "MCL with random particles": {"filter": "mcl", "recovery": "random"},
    "sensor resetting": {"filter": "sensor-resetting"},
    "MCL": {"filter": "mcl", "recovery": "none"},
}


@dataclass(frozen=True)
class Job:
    """One run of a study."""

    study: str
    recording: Recording
    method: str
    seed: int
    entries: dict[str, Any] = field(default_factory=dict)

    @property
    def key(self) -> str:
        start = self.entries.get("start", 0.0)
        return f"{self.study} {self.recording.name} {self.method} {self.seed} {start:.3f}"

    def __call__(self) -> dict[str, Any]:
        run = Run(self.recording.config(**self.entries, seed=self.seed))
        assert run.truth is not None
        kidnappings: tuple[float, ...] = ()
        if self.study == "kidnapped" and self.recording is not KIDNAPPED:
            moved = teleported(run.log, run.truth, self.seed, per_metre=PER_METRE)
            run.log, run.truth, kidnappings = moved, moved.truth, moved.kidnappings
        for _ in run:
            pass
        t, told = run.history.wheels.t, run.history.trajectory
        errors = with_withheld(pose_errors(told, run.truth), run.truth, (t[0], t[-1]))
        moves = find_kidnappings(errors.t, errors.reference, run.history.wheels, kidnappings)
        summary = summarize(run, accuracy_of(run))
        return {
            "study": self.study,
            "log": self.recording.name,
            "method": self.method,
            "seed": self.seed,
            "start": self.entries.get("start"),
            "accuracy": summary["accuracy"],
            "realtime": summary["realtime_factor"],
            "update_ms": summary["update_ms"]["median"],
            "mean_ms": float(1e3 * run.history.updates.table[1:, 1].mean()),
            "lost": errors.lost_fraction(2.0),
            "first": _stretches(found(errors, moves)[:1])[0],
            **{name: _stretches(judged(errors, moves)[1:]) for name, judged in JUDGED.items()},
        }


JUDGED: dict[str, Callable[..., Any]] = {"found": found, "stays": recoveries}


def _stretches(recovered: list[Any]) -> list[list[Any]]:
    """[metres to drive, metres until it was found, whether it was] of each kidnapping."""
    return [[r.path_m, r.after_m, r.recovered] for r in recovered]


def from_true_start(truth: Any) -> dict[str, Any]:
    return {"start": truth.t[0] - 1e-3, "initial": tuple(map(float, truth.poses[0]))}


def jobs() -> Iterator[Job]:
    """Every run."""
    both = {"mixture": METHODS["mixture"], "MCL": METHODS["augmented MCL"]}
    for recording in RECORDINGS:
        truth = read_trajectory(DATA / recording.truth)
        for method, parts in both.items():
            for seed in range(SEEDS):
                yield Job("tracking", recording, method, seed, {**from_true_start(truth), **parts})
        driven = np.hypot(*np.diff(truth.poses[:, :2], axis=0).T)
        left = driven.sum() - np.concatenate([[0.0], np.cumsum(driven)])
        last = np.flatnonzero(left >= LEAST_LEFT)[-1]
        for t in truth.t[np.linspace(0, last, STARTS).astype(int)]:
            for method, parts in both.items():
                entries = parts if method == "mixture" else limited(parts, MANY)
                for seed in range(GLOBAL_SEEDS):
                    begun = {"start": t - 1e-3, **entries}
                    yield Job("global", recording, method, 100 + seed, begun)
    for recording in (KIDNAPPED, *TELEPORTED):
        truth = read_trajectory(DATA / recording.truth)
        for method, parts in METHODS.items():
            for seed in range(SEEDS):
                yield Job("kidnapped", recording, method, seed, {**from_true_start(truth), **parts})


def _run(job: Job) -> dict[str, Any]:
    return job()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--rows", type=Path, default=Path("real_logs.jsonl"), help="of each run")
    parser.add_argument("--out", type=Path, default=Path("docs/results/real_logs.md"))
    arguments = parser.parse_args()
    kept = arguments.rows.read_text().splitlines() if arguments.rows.exists() else []
    whole = [line for line in kept if line.endswith("}")]  # the last one may have been cut
    rows = {row.pop("key"): row for row in map(json.loads, whole)}
    everything = list(jobs())
    todo = [job for job in everything if job.key not in rows]
    with ProcessPoolExecutor(arguments.jobs) as pool, arguments.rows.open("a") as file:
        running = {pool.submit(_run, job): job for job in todo}
        for done, future in enumerate(as_completed(running), 1):
            key, row = running[future].key, future.result()
            rows[key] = row
            file.write("\n" + json.dumps({"key": key, **row}))
            file.flush()
            print(f"\r{done}/{len(todo)} {key}          ", end="", flush=True)
    head = f"# Real logs\n\nMeasured with mcloc {__version__}, default configuration, by\n\n"
    text = head + "\n".join(tables([rows[job.key] for job in everything])) + "\n"
    # What was written by hand after the tables stays.
    old = arguments.out.read_text() if arguments.out.exists() else ""
    _, mark, by_hand = old.partition("## Against what was asked of it")
    arguments.out.write_text(text + ("\n" + mark + by_hand if mark else ""))


if __name__ == "__main__":
    main()
