"""Each operation and its reference, and the beam model against a plain one, with pytest-benchmark:

    python -m pytest benchmarks --benchmark-group-by=group --benchmark-columns=median,stddev,rounds

`mcloc bench` measures the same operations; here more can be had: histograms, comparisons, JSON.
"""

import sys
from pathlib import Path

import numpy as np
import pytest

from mcloc.benchmarks.bench import Plan
from mcloc.benchmarks.operations import OPERATIONS, WITHOUT_PARTICLES, Case
from mcloc.benchmarks.scene import RANGE_MAX, Scene, demo_map
from mcloc.kernels.jit import set_threads
from mcloc.sensors.beam_presets import FourPartBeams

sys.path.insert(0, str(Path(__file__).parent))
from bresenham import log_likelihood

SCENE = Scene.on(demo_map())
N, BEAMS = 10_000, 60
CASES = Plan(particles=(N,), beams=(BEAMS,)).cases(SCENE)


@pytest.fixture(autouse=True)
def one_thread():
    set_threads(1)


@pytest.mark.parametrize("side", ["ours", "reference"])
@pytest.mark.parametrize(
    ("name", "case"), CASES, ids=[f"{name}-{case.cloud}" for name, case in CASES]
)
def test_operation(benchmark, name, case, side):
    alone = OPERATIONS[name] in WITHOUT_PARTICLES
    benchmark.group = name if alone else f"{name}, {case.cloud}, {N} particles"
    run = getattr(OPERATIONS[name](case), side)
    benchmark.pedantic(run, rounds=10, warmup_rounds=1)


def by_bresenham(case):
    """The log-likelihoods of a case by the plain algorithm, from the same map and table."""
    sensor, z = FourPartBeams(SCENE.grid, max_beams=BEAMS), SCENE.scan(BEAMS)
    table = sensor.log_table(z.ranges, RANGE_MAX)
    stops = np.ascontiguousarray(sensor.rays.stops[1:-1, 1:-1])
    x, y = (float(v) for v in SCENE.grid.origin[:2])
    rest = (z.angles, stops, x, y, SCENE.grid.resolution, RANGE_MAX, table, sensor.spacing)
    return lambda: sensor.tempering(z) * log_likelihood(case.states, *rest)


@pytest.mark.parametrize("cloud", ["tracking", "uniform"])
@pytest.mark.parametrize("side", ["ours", "bresenham"])
def test_beam_model(benchmark, cloud, side):
    case = Case(SCENE, cloud, N, BEAMS)
    benchmark.group = f"beam model, {cloud}, {N} particles: exact rays against plain Bresenham"
    ours, plain = OPERATIONS["beam_cast"](case).ours, by_bresenham(case)
    assert np.corrcoef(ours(), plain())[0, 1] > 0.98  # the same model, but for its rounding
    benchmark.pedantic(ours if side == "ours" else plain, rounds=10, warmup_rounds=1)
