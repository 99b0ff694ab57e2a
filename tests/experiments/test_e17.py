"""E17: how a spacing is chosen, and that E15 and E16 have it."""

import json
from pathlib import Path

import numpy as np
import pytest

from mcloc.experiments import e17_grid_spacing as e17
from mcloc.experiments import yee_runs as runs
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table

NEAR = (0.82, 0.81, 0.80, 0.76, 0.7, 0.6, 0.5, 0.25, 0.12, 0.05)
LOST = (0.04,) * 8 + (0.06, 0.2)


def table_of(near: tuple[float, ...], lost: tuple[float, ...]) -> Table:
    rng = np.random.default_rng(0)
    rows = []
    for spacing, share, rate in zip(e17.SPACINGS, near, lost, strict=True):
        for seed in range(12):
            noise = 0.01 * rng.standard_normal(2)
            of = {"spacing_m": spacing}
            rows.append(Row({"test": e17.PROPOSAL, **of}, seed, {"near": share + noise[0]}))
            rows.append(Row({"test": e17.FILTER, **of}, seed, {"lost": rate * (1.0 + noise[1])}))
    return Table(rows)


@pytest.mark.parametrize(
    ("near", "spacing"),
    [
        (NEAR, 0.2),
        ((0.82,) * 10, 1.5),
        ((0.6, 0.7, 0.9, 0.86, 0.5, 0.4, 0.3, 0.2, 0.1, 0.1), 0.25),  # none but the best matters
    ],
)
def test_the_widest_is_chosen_that_misses_few(near: tuple[float, ...], spacing: float) -> None:
    assert e17.chosen(table_of(near, LOST)) == spacing


@pytest.mark.parametrize(
    ("near", "verdict"),
    [
        (NEAR, Verdict.IN_PART),  # 0.82 and 0.80 differ by 2 deviations of the noise
        (tuple(0.9 / (1.0 + 10.0 * s) for s in e17.SPACINGS), Verdict.REPRODUCED),
        (tuple(0.1 + 0.1 * s for s in e17.SPACINGS), Verdict.NOT),
    ],
)
def test_errors_have_to_grow_with_every_doubling(near: tuple[float, ...], verdict: Verdict) -> None:
    near = (*near[:2], near[0], *near[3:]) if verdict is Verdict.IN_PART else near
    assert e17.grows(table_of(near, LOST)).verdict is verdict


@pytest.mark.parametrize(
    ("lost", "verdict"),
    [
        (LOST, Verdict.REPRODUCED),
        ((0.04,) * 10, Verdict.IN_PART),  # any would do
        ((0.01,) + (0.04,) * 8 + (0.2,), Verdict.NOT),  # the finest is better by 3 points
    ],
)
def test_the_choice_suits_where_no_other_is_better_and_some_is_worse(
    lost: tuple[float, ...], verdict: Verdict
) -> None:
    found = e17.suits(table_of(NEAR, lost))
    assert found.verdict is verdict
    assert "0.2 m that are chosen" in found.what


def test_e15_and_e16_have_the_spacing_that_was_chosen() -> None:
    """That the recorded figure follows from the table is tested with all studies."""
    results = Path(__file__).parents[2] / "docs" / "results" / "e17" / "verdict.json"
    recorded = json.loads(results.read_text(encoding="utf-8"))["claims"][1]["figure"]
    assert f"with the {runs.SPACING:g} m that are chosen" in recorded


def test_a_wide_grid_is_worse_in_one_look(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(e17, "EVERY", 20)
    fine, again, wide = (
        e17.run({"test": e17.PROPOSAL, "spacing_m": s}, 0) for s in (0.25, 0.25, 1.5)
    )
    assert {**fine, "scan_ms": 0} == {**again, "scan_ms": 0}
    assert fine["near"] > wide["near"] + 0.3
    assert fine["best_m"] < wide["best_m"]
    assert fine["points"] > 20 * wide["points"]
    assert fine["lost"] is None


def test_a_run_of_the_filter_is_over_all_paths() -> None:
    record = e17.run({"test": e17.FILTER, "spacing_m": 0.3}, 0)
    assert record["recovered"] in (0.0, 0.25, 0.5, 0.75, 1.0)
    assert 0.0 < record["lost"] < 0.2
    assert record["near"] is None
