"""E23: how its claims are decided, and what its runs on the circle are."""

import numpy as np
import pytest

from mcloc.experiments import e23_too_sure as e23
from mcloc.experiments import team_row as row
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table
from mcloc.experiments.team_runs import ALONE, EVERY, JOINT, TEMPERED, WINDOW, on_row

MISSED = {ALONE: 0.05, EVERY: 0.4, WINDOW: 0.15, TEMPERED: 0.1, JOINT: 0.05}
OFF = {ALONE: 2.0, EVERY: 1.0, WINDOW: 1.0, TEMPERED: 1.0, JOINT: 0.8}

Changes = dict[tuple[str, str], float]


def table_of(
    missed: Changes | None = None,
    off: Changes | None = None,
    *,
    runs: int = 100,
    noise: float = 0.3,
) -> Table:
    """Runs around MISSED and OFF, changed by (place, method)."""
    rng = np.random.default_rng(3)
    rows = []
    for setting in e23.STUDY.settings():
        place, method = str(setting["place"]), str(setting["method"])
        misses = (missed or {}).get((place, method), MISSED[method])
        errs = (off or {}).get((place, method), OFF[method])
        on_circle = place == e23.ROW
        for seed in range(runs):
            a, b = rng.uniform(1.0 - noise, 1.0 + noise, 2)
            record = {
                "missed": misses * a,
                "off": errs * b,
                "nees": None if on_circle else 3.0,
                "surprise": 1.0 + misses * a if on_circle else None,
            }
            rows.append(Row(setting, seed, record))
    return Table(rows)


def everywhere(method: str, value: float) -> Changes:
    return {(place, method): value for place in e23.PLACES}


def test_the_joint_belief_is_on_the_circle_alone() -> None:
    settings = e23.STUDY.settings()
    assert len(settings) == 3 * 4 + 1
    assert [s["place"] for s in settings if s["method"] == JOINT] == [e23.ROW]


@pytest.mark.parametrize(
    ("claim", "missed", "off", "verdict"),
    [
        (0, {}, {}, Verdict.REPRODUCED),
        (0, {(e23.LED, EVERY): 0.05}, {}, Verdict.IN_PART),
        (0, everywhere(EVERY, 0.03), {}, Verdict.NOT),
        (1, {}, {}, Verdict.REPRODUCED),
        (1, {(e23.ROW, WINDOW): 0.4}, {}, Verdict.IN_PART),
        (1, everywhere(WINDOW, 0.5), {}, Verdict.NOT),
        (2, {}, {}, Verdict.REPRODUCED),
        (2, {}, {(e23.WHEELS_ALONE, WINDOW): 2.0}, Verdict.IN_PART),
        (2, {}, everywhere(WINDOW, 3.0), Verdict.NOT),
        (3, {}, {}, Verdict.REPRODUCED),
        (3, {(e23.LED, TEMPERED): 0.15}, {}, Verdict.IN_PART),
        (3, everywhere(TEMPERED, 0.15), {}, Verdict.NOT),
        (4, everywhere(TEMPERED, 0.08), {}, Verdict.REPRODUCED),
        (4, {(e23.ROW, TEMPERED): 0.08, (e23.LED, TEMPERED): 0.12}, {}, Verdict.IN_PART),
        (4, everywhere(TEMPERED, 0.12), {}, Verdict.NOT),
        (5, {}, {}, Verdict.REPRODUCED),
        (5, {(e23.ROW, TEMPERED): 0.05}, {}, Verdict.IN_PART),
        (5, {(e23.ROW, JOINT): 0.08}, {}, Verdict.IN_PART),
        (5, {(e23.ROW, JOINT): 0.12}, {}, Verdict.NOT),
    ],
)
def test_verdicts(claim: int, missed: Changes, off: Changes, verdict: Verdict) -> None:
    found = e23.STUDY.claims[claim].decide(table_of(missed, off))
    assert found.verdict is verdict


def test_the_place_that_is_shown_is_where_it_holds_the_least() -> None:
    found = e23.too_sure(table_of({(e23.LED, EVERY): 0.2}))
    assert f"{EVERY} to {ALONE}, {e23.LED}" in found.what
    assert found.figure.value == pytest.approx(4.0, rel=0.1)
    found = e23.no_harm(table_of(off={(e23.ROW, WINDOW): 1.6}))
    assert f"{WINDOW} to {ALONE}, {e23.ROW}" in found.what
    assert found.figure.value == pytest.approx(0.8, rel=0.1)


def test_few_runs_and_nothing_missed_have_verdicts() -> None:
    from matplotlib.figure import Figure

    for table in (
        table_of(runs=1),
        table_of({(p, m): 0.0 for p in e23.PLACES for m in e23.METHODS}, runs=3),
        table_of({**everywhere(ALONE, 0.0), **everywhere(WINDOW, 0.0)}, runs=30),
    ):
        e23.draw(table, Figure())
        for claim in e23.STUDY.claims:
            assert claim.decide(table).verdict in Verdict
    assert e23.too_sure(table).verdict is Verdict.REPRODUCED  # of what is never missed alone


@pytest.mark.parametrize("method", [ALONE, EVERY, WINDOW, TEMPERED, JOINT])
def test_a_run_on_the_circle_is_the_same_each_time(method: str) -> None:
    setting = {"place": e23.ROW, "method": method}
    record = e23.run(setting, 5)
    assert record == on_row(method, 5)
    assert record["nees"] is None
    assert 0.0 <= record["missed"] <= 1.0
    if method == ALONE:  # robots that are told nothing know nothing
        assert record["missed"] == pytest.approx(0.05)
        assert record["surprise"] == pytest.approx(np.log(row.CELLS))


def test_an_office_is_with_a_leader_or_without(monkeypatch: pytest.MonkeyPatch) -> None:
    from mcloc.experiments import team_runs

    def followed(seed: int, leads: bool, policy: object) -> list[tuple[float, float, float]]:
        assert (seed, policy) == (2, team_runs.POLICIES[WINDOW])
        return [(1.0, 2.0, 0.5), (0.0, 9.0, 1.5 if leads else 3.5)]

    monkeypatch.setattr(team_runs, "followed", followed)
    for place, off in ((e23.LED, 1.0), (e23.WHEELS_ALONE, 2.0)):
        record = e23.run({"place": place, "method": WINDOW}, 2)
        assert record == {"missed": 0.5, "off": off, "nees": 5.5, "surprise": None}
