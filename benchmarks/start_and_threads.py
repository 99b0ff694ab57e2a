"""What `mcloc bench` does not measure: the first run on a machine, two threads, and a big map.

python benchmarks/start_and_threads.py
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import numba
import numpy as np

from mcloc.benchmarks.operations import OPERATIONS, Case
from mcloc.benchmarks.scene import Scene, demo_map
from mcloc.kernels.jit import set_threads, share
from mcloc.maps.occupancy import OccupancyGrid

START = """
from time import perf_counter
import numpy as np
began = perf_counter()
import numba
imported = perf_counter()
from mcloc.events import Scan
from mcloc.localizer import Localizer
from mcloc.maps.occupancy import OccupancyGrid
grid = OccupancyGrid(np.pad(np.zeros((20, 20)), 2, constant_values=100), 0.1, np.zeros(3))
scans = [Scan(t, np.ones(9), np.linspace(-1, 1, 9), 8.0, odometry=np.full(3, t)) for t in (0.0, 1)]
ready = perf_counter()
list(Localizer(grid, seed=1).run(scans))
print(f"kernels {perf_counter() - ready:.2f} s, importing Numba {imported - began:.2f} s")
"""

BIG = """
import resource
from time import perf_counter
from mcloc import Localizer, OccupancyGrid
began = perf_counter()
Localizer(OccupancyGrid.load("big.yaml"), seed=1)
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
print(f"{perf_counter() - began:.1f} s, {peak:.2f} GB")
"""


@numba.njit(nogil=True, cache=True)
def plain(x: Any, out: Any, start: int, stop: int) -> None:
    """A loop that shares nothing and waits for nothing."""
    for i in range(start, stop):
        value = x[i]
        for _ in range(60):
            value = value * 1.0001 + 0.1
        out[i] = value


def said(program: str, folder: str, **environment: str) -> str:
    run = [sys.executable, "-c", program]
    env = {**os.environ, **environment}
    return subprocess.run(
        run, cwd=folder, env=env, capture_output=True, text=True, check=True
    ).stdout


def gain(run: Callable[[], Any]) -> float:
    """How many times as fast two threads are as one, the best of seven runs of each."""
    best = []
    for threads in (1, 2):
        set_threads(threads)
        times = []
        for _ in range(8):
            began = perf_counter()
            run()
            times.append(perf_counter() - began)
        best.append(min(times[1:]))
    return best[0] / best[1]


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        for what in ("cold", "warm", "warm"):
            print(f"{what:5}", said(START, folder, NUMBA_CACHE_DIR=folder), end="")
        cells = np.tile(demo_map().cells, (12, 13))[:7000, :10_000]
        OccupancyGrid(cells, 0.05, np.zeros(3)).save(Path(folder) / "big.yaml")
        for _ in range(2):
            print("10,000 × 7,000 cells", said(BIG, folder), end="")
    n = 1_000_000
    x, out = np.linspace(0.0, 1.0, n), np.empty(n)
    alone = gain(lambda: share(lambda a, b: plain(x, out, a, b), n, 1e9))
    step = gain(OPERATIONS["step_fixed"](Case(Scene.on(demo_map()), "tracking", n, 60)).ours)
    print(f"two threads: plain loop {alone:.2f} ×, step {step:.2f} ×, {100 * step / alone:.0f} %")


if __name__ == "__main__":
    main()
