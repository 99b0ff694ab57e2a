"""E3: how its claims are decided, and what counts as a place."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcloc.estimate import Hypothesis
from mcloc.experiments import e03_global_localization as e03
from mcloc.experiments.look import Look, places
from mcloc.experiments.results import draw
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table

OWN = {"place": e03.OFFICE, "scans": "all", "samples": 10_000, "random": 0.0}
MORE = {**OWN, "samples": 100_000}


def table_of(*shares: tuple[dict[str, Any], float], metric: str) -> Table:
    """Twenty seeds a setting, of which such a share is so."""
    return Table(
        [
            Row(setting, seed, {metric: seed < 20 * share})
            for setting, share in shares
            for seed in range(20)
        ]
    )


@pytest.mark.parametrize(
    ("office", "wean", "more", "verdict"),
    [
        (1.0, 0.9, 1.0, Verdict.REPRODUCED),
        (1.0, 0.5, 1.0, Verdict.IN_PART),
        (0.5, 0.2, 0.9, Verdict.IN_PART),
        (0.5, 0.2, 0.6, Verdict.NOT),
    ],
)
def test_verdicts_follow_the_shares(
    office: float, wean: float, more: float, verdict: Verdict
) -> None:
    settings = (OWN, office), ({**OWN, "place": "wean-1"}, wean), (MORE, more)
    assert e03.few(table_of(*settings, metric="few_1")).verdict is verdict
    finding = e03.found(table_of(*settings, metric="found_3"))
    assert finding.verdict is verdict
    assert finding.figure.value == min(office, wean)


def test_the_control_decides_nothing_but_its_own_claim() -> None:
    control = {**OWN, "place": e03.SYMMETRIC}
    table = table_of((OWN, 1.0), (control, 0.0), metric="found_3")
    assert e03.found(table).verdict is Verdict.REPRODUCED
    for share, verdict in ((0.0, Verdict.REPRODUCED), (1.0, Verdict.NOT)):
        table = table_of((OWN, 1.0), (control, share), metric="unique_3")
        assert e03.symmetric(table).verdict is verdict
    both = (control, 1.0), ({**control, "scans": "decorrelated"}, 0.0)
    assert e03.symmetric(table_of(*both, metric="unique_3")).verdict is Verdict.IN_PART


def test_a_start_with_a_place_is_not_uniform() -> None:
    rows = [Row(OWN, seed, {"places_0": 0}) for seed in range(5)]
    assert e03.uniform(Table(rows)).verdict is Verdict.REPRODUCED
    assert e03.uniform(Table([*rows, Row(OWN, 5, {"places_0": 1})])).verdict is Verdict.NOT


def at(x: float, y: float, degrees: float, share: float, sigma: float = 0.1) -> Hypothesis:
    mean = np.array([x, y, np.deg2rad(degrees)])
    return Hypothesis(mean, np.diag([sigma**2, sigma**2, 0.01]), share)


def test_neighbours_are_one_place_and_the_other_way_round_is_another() -> None:
    found = [at(0, 0, 175, 0.5), at(0.8, 0, -175, 0.2), at(0, 0, 0, 0.2), at(5, 5, 0, 0.04)]
    assert [round(p.share, 6) for p in places(found)] == [0.7, 0.2]


def test_what_is_spread_out_is_no_place() -> None:
    assert places([at(0, 0, 0, 1.0, sigma=1.5)]) == []
    assert len(places([at(0, 0, 0, 1.0, sigma=1.3)])) == 1


@pytest.mark.parametrize(
    ("found", "few", "unique", "is_found"),
    [
        ([at(0.5, 0.5, 10, 1.0)], True, True, True),
        ([at(0.5, 0.5, 10, 0.6), at(9, 9, 0, 0.4)], True, False, False),
        ([at(9, 9, 0, 0.9), at(0, 0, 0, 0.06)], True, False, False),
        ([at(9, 9, 0, 1.0)], False, True, False),
        ([at(0, 0, 90, 1.0)], False, True, False),
        ([at(0, 0, 0, 0.5), at(9, 9, 0, 0.3), at(5, 5, 0, 0.2)], False, False, False),
        ([at(0, 0, 0, 0.5), at(9, 9, 0, 0.3)], False, False, False),
    ],
)
def test_a_look_at_a_belief(
    found: list[Hypothesis], few: bool, unique: bool, is_found: bool
) -> None:
    look = Look.at(found, np.zeros(3))
    assert (look.few, look.unique, look.found) == (few, unique, is_found)


def test_looks_are_taken_along_the_way() -> None:
    driven, first = e03.started(e03.OFFICE, 0)
    seen = list(e03.looks(driven, first, OWN, 0))
    assert len(seen) == len(e03.LOOKS)
    np.testing.assert_array_equal(seen[0][2], driven.truth.poses[0])
    path = e03.travelled(driven)
    for metres, (particles, _, truth) in zip(e03.LOOKS, seen, strict=True):
        nearest = np.argmin(np.hypot(*(driven.truth.poses - truth)[:, :2].T))
        assert path[nearest] == pytest.approx(metres, abs=0.11)  # scans come each 0.1 m
        assert len(particles) == 10_000


def test_a_symmetric_office_has_two_places_for_all_there_is() -> None:
    driven, _ = e03.started(e03.SYMMETRIC, 0)
    np.testing.assert_array_equal(driven.grid.cells, driven.grid.cells[::-1, ::-1])


@pytest.mark.usefixtures("data_dir")
@pytest.mark.parametrize("place", ["freiburg-079", "intel", "wean-1"])
def test_recorded_logs_leave_ten_metres(place: str) -> None:
    starts = set()
    for seed in range(20):
        driven, first = e03.started(place, seed)
        path = e03.travelled(driven)
        assert path[-1] - path[first] >= e03.LENGTH
        starts.add(first)
    assert len(starts) > 10


def test_settings_change_one_thing_at_a_time() -> None:
    settings = e03.STUDY.settings()
    assert len(settings) == 5 * 4
    assert max(len(e03.changes(setting)) for setting in settings) == 1


def test_a_seed_gives_the_same_record_and_a_picture(tmp_path: Path) -> None:
    record = e03.run(OWN, 1)
    assert record == e03.run(OWN, 1)
    assert record != e03.run(OWN, 2)
    more = e03.run(MORE, 1)
    table = Table([Row(OWN, 1, record), Row(MORE, 1, more)])
    draw(e03.STUDY, table, tmp_path / "figure.png")
