"""What is measured is what is asked for, and told as it is documented."""

import json

import pytest
from typer.testing import CliRunner

from mcloc.benchmarks.bench import Plan, Result, cpu, described, measured
from mcloc.benchmarks.operations import OPERATIONS
from mcloc.benchmarks.scene import Scene, demo_map
from mcloc.cli.bench import spelt_out
from mcloc.cli.main import app
from mcloc.errors import MapError
from mcloc.kernels import jit

KEYS = ["operation", "cloud", "particles", "beams", "threads", "ms", "ns_per_unit"]


@pytest.fixture(autouse=True)
def threads():
    before = jit._threads
    yield
    jit.set_threads(before)


@pytest.fixture(scope="module")
def scene():
    return Scene.on(demo_map())


def test_each_operation_runs(scene):
    plan = Plan(clouds=("tracking",), particles=(100,), beams=(10,))
    for name, case in plan.cases(scene):
        (result,) = measured(name, case, (1,))
        assert result.ms > 0.0
        assert result.ratio == pytest.approx(result.reference_ms / result.ms)


def test_a_case_is_measured_once_where_it_makes_no_difference(scene):
    cases = Plan(particles=(10, 20), beams=(5, 6)).cases(scene)
    counts = {name: sum(name == n for n, _ in cases) for name in OPERATIONS}
    assert counts["step_fixed"] == 8
    assert counts["motion"] == 4
    assert counts["distance_transform"] == 1


def test_what_knows_no_particles_says_none(scene):
    (case,) = [c for n, c in Plan(particles=(10,)).cases(scene) if n == "distance_transform"]
    (result,) = measured("distance_transform", case, (1,))
    assert (result.cloud, result.particles, result.beams) == (None, None, None)
    assert result.ns_per_unit == pytest.approx(1e6 * result.ms / case.scene.grid.cells.size)


def test_the_machine_and_the_versions_are_told():
    told = described([Result("motion", "uniform", 10, None, 1, 2.0, 3.0, None, None)])
    assert told["cpu"] == cpu() != ""
    assert {"mcloc", "python", "numpy", "numba", "scipy"} <= set(told["versions"])
    assert list(told["results"][0]) == [*KEYS, "reference_ms", "ratio"]


def bench(*args):
    return CliRunner().invoke(app, ["bench", *args])


def test_json_is_all_that_is_printed():
    result = bench("--json", "--operation", "motion", "resample", "--particles", "1e2", "200")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)["results"]
    assert [(r["operation"], r["particles"]) for r in found] == [
        (name, n) for name in ("motion", "resample") for _ in range(2) for n in (100, 200)
    ]


def test_a_table_for_people():
    result = bench("--operation", "motion", "--particles", "100", "--cloud", "uniform")
    assert result.exit_code == 0, result.output
    assert "motion" in result.stdout


def test_lists_may_be_spelt_in_three_ways():
    ways = (["--beams", "60", "180"], ["--beams", "60", "--beams", "180"])
    assert spelt_out(ways[0]) == spelt_out(ways[1]) == ways[1]
    assert spelt_out(["--beams", "60,180", "--json"]) == ["--beams", "60,180", "--json"]
    assert spelt_out(["--map", "a", "b"]) == ["--map", "a", "b"]


@pytest.mark.parametrize(
    ("args", "what"),
    [
        (["--particles", "0"], "--particles takes whole numbers from 1 to"),
        (["--particles", "1e9"], "--particles takes whole numbers from 1 to"),
        (["--beams", "many"], "--beams takes whole numbers from 1 to 10000, got 'many'"),
        (["--beams", "1.5"], "--beams takes whole numbers"),
        (["--threads", "-1"], "--threads takes whole numbers"),
        (["--operation", "step_fix"], "did you mean 'step_fixed'"),
        (["--cloud", "tracked"], "did you mean 'tracking'"),
        (["--map", "nowhere.yaml"], "nowhere.yaml"),
    ],
)
def test_wrong_input(args, what):
    result = bench(*args)
    assert result.exit_code == 2
    assert what in result.stderr
    assert len(result.stderr.splitlines()) <= 2


def test_what_was_measured_before_an_interrupt_is_told(monkeypatch):
    def interrupted(name, case, threads):
        if case.n == 200:
            raise KeyboardInterrupt
        return [Result(name, case.cloud, case.n, None, 1, 2.0, 3.0, None, None)]

    monkeypatch.setattr("mcloc.benchmarks.bench.measured", interrupted)
    result = bench("--json", "--operation", "motion", "--particles", "100", "200")
    assert result.exit_code == 130
    assert [r["particles"] for r in json.loads(result.stdout)["results"]] == [100]


def test_an_operation_that_the_map_does_not_allow_is_left_out(monkeypatch):
    def refused(name, case, threads):
        raise MapError("too large")

    monkeypatch.setattr("mcloc.benchmarks.bench.measured", refused)
    result = bench("--operation", "beam_table", "--particles", "100", "--beams", "5")
    assert result.exit_code == 0
    assert "beam_table is left out: too large" in result.stderr
