"""Measures operations against their references, in turn, in the same run."""

import platform
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

from mcloc.benchmarks.operations import OPERATIONS, WITHOUT_BEAMS, WITHOUT_PARTICLES, Case, Work
from mcloc.benchmarks.scene import CLOUDS, Scene
from mcloc.kernels.jit import set_threads

TURNS, ENOUGH = 5, 2.0  # of each side; s after which it has no more
TURN, MOST_RUNS = 0.1, 50  # s and runs of one side, before it is the other's turn
LARGEST_REFERENCE = 7_000_000  # units; NumPy's temporaries take some 100 bytes for each


@dataclass(frozen=True)
class Result:
    """One operation, measured.

    cloud, particles, beams: None where it knows none. ms: median of the runs. ns_per_unit: per
    particle and beam where there are beams and only they are worked on, per cell for the distance
    transform, else per particle. reference_ms, ratio: None where the reference would need more
    memory than many machines have.
    """

    operation: str
    cloud: str | None
    particles: int | None
    beams: int | None
    threads: int
    ms: float
    ns_per_unit: float
    reference_ms: float | None
    ratio: float | None


@dataclass(frozen=True)
class Plan:
    """What to measure."""

    operations: Sequence[str] = tuple(OPERATIONS)
    clouds: Sequence[str] = CLOUDS
    particles: Sequence[int] = (1_000, 10_000, 100_000, 1_000_000)
    beams: Sequence[int] = (60, 180)
    threads: Sequence[int] = (1,)

    def cases(self, scene: Scene) -> list[tuple[str, Case]]:
        """Each operation in each case that makes a difference to it."""
        found = []
        for name in self.operations:
            made = OPERATIONS[name]
            for cloud in self.clouds[:1] if made in WITHOUT_PARTICLES else self.clouds:
                for n in self.particles[:1] if made in WITHOUT_PARTICLES else self.particles:
                    for beams in self.beams[:1] if made in WITHOUT_BEAMS else self.beams:
                        found.append((name, Case(scene, cloud, n, beams)))
        return found


def measured(name: str, case: Case, threads: Sequence[int]) -> Iterator[Result]:
    """A result for each number of threads; the reference is measured beside each."""
    made = OPERATIONS[name]
    alone, beamless = made in WITHOUT_PARTICLES, made in WITHOUT_BEAMS
    work = made(case)
    for count in threads:
        set_threads(count)
        ours, theirs = _medians(work)
        yield Result(
            name,
            None if alone else case.cloud,
            None if alone else case.n,
            None if beamless else case.beams,
            count,
            1e3 * ours,
            1e9 * ours / work.units,
            None if theirs is None else 1e3 * theirs,
            None if theirs is None else theirs / ours,
        )


def described(results: Sequence[Result]) -> dict[str, Any]:
    """All results, and the machine and versions that they are of."""
    packages = ("mcloc", "numpy", "scipy", "numba", "llvmlite")
    versions = {"python": platform.python_version(), **{name: version(name) for name in packages}}
    return {"cpu": cpu(), "versions": versions, "results": [asdict(result) for result in results]}


def cpu() -> str:
    """The processor's name."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in text.splitlines() if "model name" in line]
    return names[0] if names else platform.machine()


def _medians(work: Work) -> tuple[float, float | None]:
    """Seconds of ours and of the reference, in turn so that both meet the same machine.

    Each turn begins with a run that is not counted: it brings back to the caches what the other
    side, which takes far more memory, has driven out.
    """
    sides = [work.ours, work.reference][: 2 if work.units <= LARGEST_REFERENCE else 1]
    for side in sides:
        side()  # compiled
    times: list[list[float]] = [[] for _ in sides]
    for _ in range(TURNS):
        for taken, side in zip(times, sides, strict=True):
            if sum(taken) < ENOUGH:
                taken += _turn(side)
    return median(times[0]), median(times[1]) if len(times) == 2 else None


def _turn(run: Callable[[], Any]) -> list[float]:
    """Seconds of up to MOST_RUNS runs; of the first alone where it takes long."""
    times = [_seconds(run)]
    while len(times) <= MOST_RUNS and sum(times) < TURN:
        times.append(_seconds(run))
    return times[1:] or times


def _seconds(run: Callable[[], Any]) -> float:
    began = perf_counter()
    run()
    return perf_counter() - began
