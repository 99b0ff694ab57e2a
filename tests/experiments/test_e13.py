"""E13: how its claims are decided, and that runs with and without detections are pairs."""

import numpy as np
import pytest

from mcloc.experiments import e13_two_robots as e13
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table
from mcloc.experiments.team_world import LIMIT, MCL, MIXTURE, MOMENTS, Found, Replay

Changes = dict[tuple[str, str, bool], float]

USUAL = {
    ("time", True): 15.0,
    ("time", False): 30.0,
    ("off", True): 2.0,
    ("off", False): 4.0,
    ("lost", True): 0.1,
    ("lost", False): 0.3,
}


def table_of(changed: Changes, *, late: float = 0.0, runs: int = 200) -> Table:
    """200 runs around USUAL, changed by (metric, method, detections). late: at the first of this
    share of moments the curve with detections is above.
    """
    rng = np.random.default_rng(1)
    rows = []
    for setting in e13.STUDY.settings():
        method, seen = str(setting["method"]), bool(setting["detections"])

        def of(metric: str, method: str = method, seen: bool = seen) -> float:
            return changed.get((metric, method, seen), USUAL[metric, seen])

        for seed in range(runs):
            lost = rng.random(2) < of("lost")
            curve = np.full(len(MOMENTS), of("off"))
            if seen:
                curve[: round(late * len(curve))] = 5.0
            rows.append(
                Row(
                    setting,
                    seed,
                    {
                        "time": float(np.clip(of("time") + rng.normal(0.0, 8.0), 0.0, LIMIT)),
                        "found": 1.0,
                        "off": of("off") * float(rng.uniform(0.5, 1.5)),
                        "lost": float(lost.mean()),
                        "lost_again": float(lost.mean() / 2),
                        "used": 5,
                        "curve": curve.tolist(),
                    },
                )
            )
    return Table(rows)


@pytest.mark.parametrize(
    ("with_", "verdict"),
    [(15.0, Verdict.REPRODUCED), (27.0, Verdict.IN_PART), (30.0, Verdict.NOT), (36.0, Verdict.NOT)],
)
def test_clearly_is_a_fifth_or_more(with_: float, verdict: Verdict) -> None:
    table = table_of({("time", MCL, True): with_})
    found = e13.STUDY.claims[0].decide(table)
    assert found.verdict is verdict
    assert found.figure.value == pytest.approx(with_ / 30.0, rel=0.08)
    assert found.figure.low < found.figure.value < found.figure.high
    assert "In the first 10 runs" in found.note
    ours = e13.STUDY.claims[3].decide(table)
    assert ours.verdict is Verdict.REPRODUCED


def test_each_filter_has_a_claim_of_its_own() -> None:
    table = table_of({("time", MIXTURE, True): 30.0})
    assert e13.papers_sooner(table).verdict is Verdict.REPRODUCED
    assert e13.ours_sooner(table).verdict is Verdict.NOT


def test_the_first_runs_are_as_many_as_the_papers() -> None:
    few = e13.first_runs(table_of({}))
    assert len(few) == 10 * len(e13.STUDY.settings())
    assert {row.seed for row in few.rows} == set(range(10))


@pytest.mark.parametrize(
    ("off", "late", "verdict"),
    [
        (2.0, 0.0, Verdict.REPRODUCED),
        (2.0, 0.07, Verdict.REPRODUCED),
        (2.0, 0.3, Verdict.IN_PART),
        (4.0, 0.0, Verdict.NOT),
    ],
)
def test_the_curve_lies_below(off: float, late: float, verdict: Verdict) -> None:
    found = e13.lower_curve(table_of({("off", MCL, True): off}, late=late))
    assert found.verdict is verdict


@pytest.mark.parametrize(
    ("method", "with_", "verdict"),
    [
        (MCL, 0.1, Verdict.REPRODUCED),
        (MCL, 0.28, Verdict.REPRODUCED),
        (MCL, 0.5, Verdict.NOT),
        (MIXTURE, 0.5, Verdict.NOT),
        (MIXTURE, 0.33, Verdict.IN_PART),
    ],
)
def test_harm_is_robots_that_are_lost_at_the_end(
    method: str, with_: float, verdict: Verdict
) -> None:
    found = e13.no_harm(table_of({("lost", method, True): with_}))
    assert found.verdict is verdict


def test_a_picture_is_drawn_of_few_runs_and_all_claims_have_a_verdict() -> None:
    from matplotlib.figure import Figure

    table = table_of({}, runs=2)
    e13.draw(table, Figure())
    for claim in e13.STUDY.claims:
        assert claim.decide(table).verdict in Verdict


def test_a_run_is_of_its_setting_and_a_mean_of_two_robots(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def replayed(drive: object, method: str, seed: int, detections: bool) -> Replay:
        asked.append((drive, method, seed, detections))
        curve = np.ones(len(MOMENTS))
        robots = {
            "1": Found(LIMIT, False, True, 3.0 * curve),
            "2": Found(10.0, True, True, curve),
        }
        return Replay(robots, 4, 100, 50)

    monkeypatch.setattr(e13, "replayed", replayed)
    monkeypatch.setattr(e13, "driven", lambda seed, robots: (seed, robots))
    record = e13.run({"method": MIXTURE, "detections": True}, 7)
    assert asked == [((7, 2), MIXTURE, 7, True)]
    assert record["curve"] == [2.0] * len(MOMENTS)
    del record["curve"]  # type: ignore[attr-defined]
    assert record == {
        "time": 35.0, "found": 0.5, "off": 2.0, "lost": 1.0, "lost_again": 0.5, "used": 4,
    }  # fmt: skip
