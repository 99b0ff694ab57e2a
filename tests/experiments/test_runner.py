"""A study from its first run to its results, interrupted and gone on with."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from mcloc.errors import ConfigError, StateError
from mcloc.experiments.plan import Plan
from mcloc.experiments.runner import conduct, opened
from mcloc.experiments.table import Record, Row, Setting

from .conftest import toy_run, toy_study


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "table.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_a_study_leaves_table_verdict_figure_and_page(out: Path) -> None:
    table = conduct(Plan.of(toy_study()), out)
    assert table.column("y").tolist() == [10.0, 11.0, 12.0, 20.0, 21.0, 22.0]
    assert [row["y"] for row in rows_of(out)] == ["10.0", "11.0", "12.0", "20.0", "21.0", "22.0"]
    assert json.loads(rows_of(out)[1]["path"]) == [1, 1]
    verdict = json.loads((out / "verdict.json").read_text(encoding="utf-8"))
    assert (verdict["runs"], verdict["seeds"], verdict["raised"]) == (6, 3, 0)
    (claim,) = verdict["claims"]
    assert claim["verdict"] == "reproduced"
    assert claim["value"] == pytest.approx(16.0)
    assert claim["interval"][0] < 16.0 < claim["interval"][1]
    assert (out / "figure.png").read_bytes().startswith(b"\x89PNG")
    page = (out / "study.md").read_text(encoding="utf-8")
    assert "| x | runs | y, m | found |" in page
    assert "| 1 | 3 | 11.0 (10.0 to 12.0) | 2 of 3, 0.667 (0.0943 to 0.992) |" in page
    assert "too few" not in page


def test_parquet_holds_the_same_table(out: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    table = conduct(Plan.of(toy_study()), out)
    read = parquet.read_table(out / "table.parquet")
    assert read.column_names == table.columns()
    assert read.column("y").to_pylist() == table.column("y").tolist()
    assert read.column("error").to_pylist() == [None] * 6


def test_results_are_the_same_bytes_but_for_the_time_they_took(tmp_path: Path) -> None:
    folders = [tmp_path / name for name in "ab"]
    for folder in folders:
        folder.mkdir()
        conduct(Plan.of(toy_study()), folder)
    one, other = folders
    for name in ("verdict.json", "study.md", "figure.png"):
        assert (one / name).read_bytes() == (other / name).read_bytes()


class StoppedError(Exception):
    pass


def test_an_interrupted_study_goes_on_without_repeating_or_losing_a_run(out: Path) -> None:
    made: list[tuple[int, int]] = []

    def counted(setting: Setting, seed: int) -> Record:
        made.append((int(setting["x"]), seed))
        return toy_run(setting, seed)

    study = toy_study(run=counted)
    seen: list[Row | None] = []

    def stop(row: Row | None) -> None:
        seen.append(row)
        if len(seen) == 4:
            raise StoppedError

    with pytest.raises(StoppedError):
        conduct(Plan.of(study), out, done=stop)
    assert len(rows_of(out)) == 4  # readable at once
    assert not (out / "verdict.json").exists()
    seen.clear()
    table = conduct(Plan.of(study), out, resume=True, done=seen.append)
    assert len(seen) == 6
    assert seen[:4] == [None] * 4
    assert sorted(made) == sorted({(x, seed) for x in (1, 2) for seed in range(3)})
    assert table.column("y").tolist() == [10.0, 11.0, 12.0, 20.0, 21.0, 22.0]


def test_more_runs_are_added_to_those_that_are_there(out: Path) -> None:
    conduct(Plan.of(toy_study(), 1), out)
    assert "1 of 3 runs for each setting: too few" in (out / "study.md").read_text(encoding="utf-8")
    table = conduct(Plan.of(toy_study()), out, resume=True)
    assert len(table) == 6


def test_fewer_runs_leave_out_the_others(out: Path) -> None:
    conduct(Plan.of(toy_study()), out)
    assert len(conduct(Plan.of(toy_study(), 1), out, resume=True)) == 2


def test_runs_that_raise_are_told_and_no_claim_holds_for_sure(out: Path) -> None:
    def broken(setting: Setting, seed: int) -> Record:
        if seed == 1:
            raise ValueError("nothing there")
        return toy_run(setting, seed)

    table = conduct(Plan.of(toy_study(run=broken)), out)
    assert len(table.failed) == 2
    assert [row["error"] != "" for row in rows_of(out)] == [False, True, False] * 2
    claim = json.loads((out / "verdict.json").read_text(encoding="utf-8"))["claims"][0]
    assert claim["verdict"] == "reproduced in part"
    assert "2 of 6 runs raised" in claim["note"]
    page = (out / "study.md").read_text(encoding="utf-8")
    assert "x = 1, seed 1: ValueError: nothing there" in page


def test_a_setting_that_tells_nothing_decides_nothing(out: Path) -> None:
    def broken(setting: Setting, seed: int) -> Record:
        if setting["x"] == 2:
            raise ValueError("nothing there")
        return toy_run(setting, seed)

    conduct(Plan.of(toy_study(run=broken)), out)
    claim = json.loads((out / "verdict.json").read_text(encoding="utf-8"))["claims"][0]
    assert claim["verdict"] == "not reproduced"
    assert claim["figure"] == "nothing: all runs of some setting raised"
    assert claim["value"] is None
    assert not (out / "figure.png").exists()
    assert "2 of 6" not in (out / "study.md").read_text(encoding="utf-8")
    assert "**3 of 6 runs raised:**" in (out / "study.md").read_text(encoding="utf-8")


def test_what_is_missing_here_is_left_out_and_told(out: Path) -> None:
    study = toy_study(missing=lambda s: "no second floor" if s["x"] == 2 else None)
    table = conduct(Plan.of(study), out)
    assert table.values("x") == [1]
    claim = json.loads((out / "verdict.json").read_text(encoding="utf-8"))["claims"][0]
    assert claim["verdict"] == "reproduced in part"  # what is missing might have contradicted
    assert claim["note"] == "1 settings were left out."
    assert "Left out, 1 settings: no second floor." in (out / "study.md").read_text("utf-8")


def test_a_study_of_which_nothing_can_be_run_is_told() -> None:
    with pytest.raises(ConfigError, match="E99: nothing of it can be run here: no floor"):
        Plan.of(toy_study(missing=lambda setting: "no floor"))


def test_no_runs_are_no_study() -> None:
    with pytest.raises(ConfigError, match="at least one run for each setting, got 0"):
        Plan.of(toy_study(), 0)


@pytest.mark.parametrize(
    ("change", "named"), [({"number": "E98"}, "study"), ({"base": "other"}, "other settings")]
)
def test_runs_of_something_else_are_not_mixed(
    out: Path, change: dict[str, object], named: str
) -> None:
    conduct(Plan.of(toy_study(), 1), out)
    with pytest.raises(StateError, match=f"begun with {named}"):
        conduct(Plan.of(toy_study(**change)), out, resume=True)


def test_runs_by_another_mcloc_are_not_mixed(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    conduct(Plan.of(toy_study(), 1), out)
    monkeypatch.setattr("mcloc.experiments.runner.sources", lambda: "another")
    with pytest.raises(StateError, match="begun with mcloc"):
        conduct(Plan.of(toy_study()), out, resume=True)


def test_runs_on_other_files_of_the_same_name_are_not_mixed(out: Path, tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.write_text("a drive")
    study = toy_study(inputs=lambda: [log])
    conduct(Plan.of(study, 1), out)
    conduct(Plan.of(study, 2), out, resume=True)
    log.write_text("another one")
    with pytest.raises(StateError, match="other input files, or they have changed"):
        conduct(Plan.of(study), out, resume=True)


def test_what_raised_is_made_again(out: Path) -> None:
    healthy = False

    def sick(setting: Setting, seed: int) -> Record:
        if seed == 1 and not healthy:
            raise ValueError("no log there")
        return toy_run(setting, seed)

    study = toy_study(run=sick)
    assert len(conduct(Plan.of(study), out).failed) == 2
    healthy = True
    seen: list[Row | None] = []
    table = conduct(Plan.of(study), out, resume=True, done=seen.append)
    assert sum(row is not None for row in seen) == 2
    assert table.failed == ()
    assert len(table) == 6


def test_a_start_that_was_refused_leaves_nothing_in_the_way(out: Path) -> None:
    with pytest.raises(ConfigError, match=r"no scheduler answers|needs Dask"):
        conduct(Plan.of(toy_study()), out, cluster="tcp://127.0.0.1:9")
    assert len(conduct(Plan.of(toy_study()), out)) == 6


def test_two_do_not_write_one_journal(out: Path) -> None:
    with (
        opened(Plan.of(toy_study()), out, resume=False),
        pytest.raises(StateError, match="at work"),
    ):
        conduct(Plan.of(toy_study()), out)


@pytest.mark.parametrize("value", [float("nan"), object(), np.int64(3)])
def test_what_cannot_be_kept_is_an_error_of_its_run(out: Path, value: object) -> None:
    def odd(setting: Setting, seed: int) -> Record:
        return {**toy_run(setting, seed), "odd": value if seed == 1 else 0}

    table = conduct(Plan.of(toy_study(run=odd)), out)
    assert [row.seed for row in table.failed] == [1, 1]
    assert "JSON" in str(table.failed[0].error)


def test_more_values_of_a_factor_are_added_to_what_is_there(out: Path) -> None:
    conduct(Plan.of(toy_study(), 1), out)
    table = conduct(Plan.of(toy_study(factors={"x": (1, 2, 3)}), 1), out, resume=True)
    assert table.values("x") == [1, 2, 3]
