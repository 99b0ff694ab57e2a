"""E15: where MCL overtakes, and that a run is one of its world's."""

import math

import numpy as np
import pytest

from mcloc.experiments import e15_reinitialisation as e15
from mcloc.experiments import yee_runs as runs
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table

FALLING = (0.95, 0.9, 0.8, 0.5, 0.3, 0.1, 0.02, 0.02)


def table_of(mcl: tuple[float, ...], ours: float, told: float) -> Table:
    """Loss rates over SIZES; told: of ours without withheld ones."""
    rng = np.random.default_rng(0)
    rows = []
    for n, share in zip(e15.TRIED, mcl, strict=True):
        for path in range(4):
            for seed in range(12):
                noise = 1.0 + 0.1 * rng.standard_normal()
                for method, lost, of_told in (
                    (runs.MCL, share * noise, share * noise),
                    (runs.RENEWING, ours * noise, told * noise),
                ):
                    setting = {"path": path, "method": method, "samples": n}
                    rows.append(Row(setting, seed, {"lost": lost, "lost_told": of_told}))
    return Table(rows)


@pytest.mark.parametrize(
    ("ours", "told", "verdict"),
    [
        (0.05, 0.04, Verdict.REPRODUCED),
        (0.05, 0.01, Verdict.IN_PART),
        (0.01, 0.01, Verdict.NOT),
        (0.0, 0.0, Verdict.NOT),
    ],
)
def test_mcl_has_to_be_better_in_both_counts(ours: float, told: float, verdict: Verdict) -> None:
    found = e15.beaten(table_of(FALLING, ours, told))
    assert found.verdict is verdict
    assert math.isinf(found.figure.value) is (ours < 0.02)
    if verdict is Verdict.REPRODUCED:
        assert 30_000 < found.figure.low <= found.figure.value <= found.figure.high < 100_000
        both = "with 100,000 and 300,000"
        assert f"withheld ones lost: {both}; withheld ones left out: {both}" in found.note


@pytest.mark.parametrize(
    ("apart", "samples"),
    [
        ([0.9, 0.8, 0.7, 0.6, 0.1, -0.1, -0.2, -0.2], math.sqrt(10_000 * 30_000)),
        ([0.9, -0.8, 0.7, 0.6, 0.0, -0.1, -0.2, -0.2], 10_000),
        ([0.9, 0.8, 0.7, 0.6, 0.1, -0.1, -0.1, 0.0], math.inf),
        ([-0.1] * 8, 100),
    ],
)
def test_the_crossing_is_where_mcl_is_better_up_to_the_largest(
    apart: list[float], samples: float
) -> None:
    assert e15.crossing(np.array(apart)) == pytest.approx(samples)


def test_all_claims_are_decided_with_few_runs() -> None:
    """A seed gives the same record but for the clock; the table of two seeds decides."""
    setting = {"path": 0, "method": runs.RENEWING, "samples": 100}
    one, again, other = (e15.run(setting, seed) for seed in (0, 0, 1))
    assert {**one, "update_ms": 0} == {**again, "update_ms": 0}
    assert one["error_m"] != other["error_m"]
    assert one["lost"] < 0.1
    assert e15.run({**setting, "method": runs.MCL}, 0)["lost"] > 0.5
    rows = [
        Row(setting, seed, {**one, "lost": 0.1 + 0.01 * seed})
        for setting in e15.STUDY.settings()
        for seed in range(2)
    ]
    for claim in e15.STUDY.claims:
        claim.decide(Table(rows))
