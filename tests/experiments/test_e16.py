"""E16: how its claims are decided, and that its robots are kidnapped."""

from collections.abc import Callable

import numpy as np
import pytest

from mcloc.experiments import e16_kidnapped as e16
from mcloc.experiments import yee_claims as claims
from mcloc.experiments import yee_runs as runs
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Record, Row, Table
from mcloc.experiments.yee_world import path

USUAL = {runs.MCL: 0.8, runs.RANDOM: 0.3, runs.RENEWING: 0.04}


def table_of(changed: Callable[[str, int, int], Record] | None = None) -> Table:
    """Loss rates around USUAL, waits of 1 s of ours and 5 s of others; changed: by method, samples
    and seed.
    """
    rng = np.random.default_rng(0)
    rows = []
    for setting in e16.STUDY.settings():
        method, n = str(setting["method"]), int(setting["samples"])
        for seed in range(10):
            noise = 1.0 + 0.1 * rng.standard_normal()
            lost = USUAL.get(method, 0.5) * noise
            waited = (1.0 if method == runs.RENEWING else 5.0) * noise
            record = {
                "lost": lost,
                "lost_told": lost,
                "error_m": 0.02 * noise,
                "found": True,
                "after_s": waited,
                "waited_s": waited,
                "errors_m": None,
                **(changed(method, n, seed) if changed else {}),
            }
            rows.append(Row(setting, seed, record))
    return Table(rows)


def test_other_thresholds_are_tried_with_the_largest_number_too() -> None:
    tried = {
        name: {s["samples"] for s in e16.STUDY.settings() if s["method"] == name}
        for name in e16.STUDY.factors["method"]
    }
    assert tried[runs.RENEWING] == set(runs.SIZES)
    assert all(tried[name] == {100, 1000} for name in e16.OTHER_SHARES)
    assert all(tried[name] == {100, 1000, 100_000} for name in runs.OTHER_THRESHOLDS)


def test_all_hold_where_it_is_better_everywhere() -> None:
    table = table_of()
    assert [claim.decide(table).verdict for claim in e16.STUDY.claims] == [Verdict.REPRODUCED] * 4


def test_superior_is_with_each_size_in_both_counts() -> None:
    def as_good(metrics: tuple[str, ...], sizes: tuple[int, ...]) -> Table:
        return table_of(
            lambda method, n, seed: (
                dict.fromkeys(metrics, 0.01)
                if method in (runs.MCL, runs.RANDOM) and n in sizes
                else {}
            )
        )

    assert e16.superior(as_good(("lost_told",), (100_000,))).verdict is Verdict.IN_PART
    assert e16.superior(as_good(tuple(claims.COUNTS), runs.SIZES)).verdict is Verdict.NOT
    found = e16.superior(as_good(("lost",), (100_000,)))
    assert "100,000 samples" in found.what
    assert found.figure.value == pytest.approx(-3.0, abs=0.3)
    assert "in 26 of 28 comparisons" in found.note


@pytest.mark.parametrize(
    ("missed", "verdict"),
    [(0, Verdict.REPRODUCED), (1, Verdict.IN_PART), (7, Verdict.NOT)],
)
def test_recovery_is_a_share_of_all_runs(missed: int, verdict: Verdict) -> None:
    """Of 40: 4 that are not found are enough for a lower limit below 90 %."""

    def changed(method: str, n: int, seed: int) -> Record:
        lost = method == runs.RENEWING and n == 100 and seed < missed
        return {"found": False, "after_s": None, "waited_s": 20.0} if lost else {}

    found = e16.recovers(table_of(changed))
    assert found.verdict is verdict
    assert found.figure.value == pytest.approx(1.0 - missed / 10)


@pytest.mark.parametrize(
    ("sizes", "verdict"),
    [((), Verdict.REPRODUCED), ((100_000,), Verdict.IN_PART), (runs.SIZES, Verdict.NOT)],
)
def test_faster_is_with_each_size(sizes: tuple[int, ...], verdict: Verdict) -> None:
    soon = table_of(
        lambda method, n, seed: {"waited_s": 0.3} if method == runs.RANDOM and n in sizes else {}
    )
    assert e16.faster(soon).verdict is verdict


def test_comparisons_are_corrected_for_each_other() -> None:
    def close(method: str, n: int, seed: int) -> Record:
        return {"waited_s": 1.0 + 0.1 * seed} if method == runs.RANDOM else {}

    table = table_of(close)
    found = e16.compared(table, ("waited_s",), (runs.RANDOM,))
    theirs, ours = claims.by_seed(
        table,
        "waited_s",
        *({"method": m, "samples": 100} for m in (runs.RANDOM, runs.RENEWING)),
    )
    alone = e16.paired_p(theirs, ours)
    assert alone < found[0][2] <= 7 * alone


def test_a_run_is_found_again_and_the_shown_one_keeps_its_errors() -> None:
    setting = {"path": 0, "method": runs.RENEWING, "samples": 100}
    shown, again, other = (e16.run(setting, seed) for seed in (0, 0, 1))
    assert {**shown, "update_ms": 0} == {**again, "update_ms": 0}
    assert shown["found"]
    assert 0.0 < shown["after_s"] < 5.0
    at = len(path(0)) // 2
    errors = [e for e in shown["errors_m"][at - 5 : at] if e is not None]
    assert max(errors) < 0.5
    assert shown["errors_m"][at] is None or shown["errors_m"][at] > 0.5
    assert other["errors_m"] is None
    lost = e16.run({**setting, "method": runs.MCL}, 0)
    assert not lost["found"]
    assert lost["waited_s"] > 15.0
