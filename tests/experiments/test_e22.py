"""E22: how its claims are decided, and that alone is the first two robots of ten, unseen."""

import numpy as np
import pytest

from mcloc.experiments import e22_team_size as e22
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table
from mcloc.experiments.team_world import MCL, MOMENTS, Found, Replay
from mcloc.simulation import TeamDrive

TIMES = {1: 30.0, 2: 26.0, 3: 22.0, 5: 17.0, 10: 10.0}


def table_of(
    times: dict[int, float] | None = None,
    lost: dict[int, float] | None = None,
    cost: float = 0.5,
    runs: int = 100,
) -> Table:
    """Runs around these times, with these shares lost, 0.2 where not told; cost: of ten robots."""
    rng = np.random.default_rng(2)
    rows = []
    for n in e22.ROBOTS:
        for seed in range(runs):
            gone = rng.random(2) < (lost or {}).get(n, 0.2)
            scans = float(n * rng.uniform(3e5, 4e5))
            record = {
                "time": float({**TIMES, **(times or {})}[n] * rng.uniform(0.7, 1.3)),
                "found": 0.9,
                "lost": float(gone.mean()),
                "all_found": 0.9,
                "used": float(n),
                "pushed": cost * scans * (n - 1) / 9 * rng.uniform(0.9, 1.1),
                "weighed": scans,
                "busy": 0.1,
            }
            rows.append(Row({"robots": n}, seed, record))
    return Table(rows)


@pytest.mark.parametrize(
    ("times", "verdict"),
    [
        ({}, Verdict.REPRODUCED),
        ({5: 10.0}, Verdict.IN_PART),
        ({10: 17.0}, Verdict.IN_PART),
        (dict.fromkeys(TIMES, 20.0), Verdict.NOT),
        ({n: 40.0 - t for n, t in TIMES.items()}, Verdict.NOT),
    ],
)
def test_each_larger_team_is_sooner(times: dict[int, float], verdict: Verdict) -> None:
    found = e22.sooner(table_of(times))
    assert found.verdict is verdict
    assert found.note.count(" robots to ") == 4


@pytest.mark.parametrize(
    ("lost", "verdict"),
    [
        (dict.fromkeys(e22.ROBOTS[1:], 0.05), Verdict.REPRODUCED),
        ({10: 0.5}, Verdict.NOT),
        ({2: 0.05, 3: 0.05, 5: 0.05, 10: 0.22}, Verdict.IN_PART),
    ],
)
def test_harm_is_in_any_team(lost: dict[int, float], verdict: Verdict) -> None:
    found = e22.no_harm(table_of(lost=lost))
    assert found.verdict is verdict


@pytest.mark.parametrize(
    ("cost", "verdict"), [(0.9, Verdict.REPRODUCED), (1.0, Verdict.IN_PART), (1.2, Verdict.NOT)]
)
def test_cost_is_counted_in_particles(cost: float, verdict: Verdict) -> None:
    found = e22.affordable(table_of(cost=cost))
    assert found.verdict is verdict
    assert found.figure.value == pytest.approx(cost, rel=0.05)


def test_a_picture_is_drawn_and_one_run_has_verdicts() -> None:
    from matplotlib.figure import Figure

    table = table_of(runs=1)
    e22.draw(table, Figure())
    for claim in e22.STUDY.claims:
        assert claim.decide(table).verdict in Verdict


@pytest.mark.parametrize(("robots", "size"), [(1, 2), (2, 2), (5, 5), (10, 10)])
def test_a_run_is_of_the_first_robots(
    monkeypatch: pytest.MonkeyPatch, robots: int, size: int
) -> None:
    def replayed(drive: TeamDrive, method: str, seed: int, detections: bool) -> Replay:
        assert (method, seed, detections) == (MCL, 3, robots > 1)
        found = {
            name: Found(float(name), name == "2", name == "1", np.zeros(len(MOMENTS)))
            for name in drive.events
        }
        return Replay(found, 6, 100, 50)

    names = [str(k + 1) for k in range(10)]
    ten = TeamDrive(None, dict.fromkeys(names, ()), dict.fromkeys(names))  # type: ignore[arg-type]
    monkeypatch.setattr(e22, "driven", lambda seed, n: ten if (seed, n) == (3, 10) else None)
    monkeypatch.setattr(e22, "replayed", replayed)
    record = dict(e22.run({"robots": robots}, 3))
    assert record.pop("busy") >= 0.0
    assert record == {
        "time": 1.5, "found": 0.5, "lost": 0.5, "all_found": 1 / size, "used": 6 / size,
        "pushed": 50, "weighed": 100,
    }  # fmt: skip
