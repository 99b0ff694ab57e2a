"""What docs/results says of the studies is what their full runs gave."""

import csv
import importlib.util
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from mcloc.experiments.catalog import STUDIES
from mcloc.experiments.study import Study
from mcloc.experiments.table import Row, Setting, Table, Value

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "docs" / "results"


def read_csv(path: Path, factors: Mapping[str, Sequence[Value]]) -> Table:
    """A table from `to_csv`. factors: {name: values}; a cell becomes the value that it is of."""
    value_of = {name: {str(v): v for v in values} for name, values in factors.items()}
    rows = []
    with path.open(encoding="utf-8", newline="") as file:
        for line in csv.DictReader(file):
            seed, error, took = (line.pop(name) for name in ("seed", "error", "took_s"))
            setting = {name: of[line.pop(name)] for name, of in value_of.items()}
            record = None if error else {name: _read(cell) for name, cell in line.items()}
            rows.append(Row(setting, int(seed), record, error or None, float(took)))
    return Table(rows)


def _read(cell: str) -> Any:
    """A metric from its cell: a number, true or false, a list, text; None where it is empty."""
    if cell in ("", "True", "False"):
        return {"": None, "True": True, "False": False}[cell]
    try:
        return json.loads(cell)
    except ValueError:
        return cell


studies = pytest.mark.parametrize("study", STUDIES.values(), ids=list(STUDIES))


def verdict_of(study: Study) -> dict[str, object]:
    return dict(json.loads((RESULTS / study.folder / "verdict.json").read_text(encoding="utf-8")))


@studies
def test_every_study_was_run_in_full(study: Study) -> None:
    verdict = verdict_of(study)
    assert verdict["seeds"] == study.seeds
    assert verdict["raised"] == 0
    assert verdict["left_out"] == {}
    assert verdict["runs"] == len(study.settings()) * study.seeds


@studies
def test_claims_and_predictions_are_those_of_the_study(study: Study) -> None:
    recorded = verdict_of(study)["claims"]
    assert isinstance(recorded, list)
    assert [(c["claim"], c["paper"], c["prediction"]) for c in recorded] == [
        (claim.text, claim.paper, claim.prediction) for claim in study.claims
    ]


@studies
def test_the_verdicts_follow_from_the_table(study: Study) -> None:
    table = read_csv(RESULTS / study.folder / "table.csv", study.factors)
    recorded = verdict_of(study)["claims"]
    assert isinstance(recorded, list)
    for claim, told in zip(study.claims, recorded, strict=True):
        finding = claim.decide(table)
        assert (finding.verdict, finding.what) == (told["verdict"], told["figure"])
        assert str(finding.figure) == told["told"]


CHEAP = {
    "E1": {"step": 0.25, "noise": 1.0},
    "E2": {"place": "generated office", "beams": 12.0},
    "E5": {"place": "generated office", "pace": "1999", "scans": "all", "samples": 2000},
}


@pytest.mark.parametrize(("number", "setting"), CHEAP.items())
def test_a_recorded_row_is_what_its_run_gives_today(number: str, setting: Setting) -> None:
    """Not stale: within 2 %, since the last bits may differ from processor to processor."""
    study = STUDIES[number]
    table = read_csv(RESULTS / study.folder / "table.csv", study.factors).where(**setting)
    recorded = next(row.record for row in table.rows if row.seed == 1)
    assert recorded is not None
    record = study.run(setting, 1)
    for metric in study.metrics:
        assert record[metric] == pytest.approx(recorded[metric], rel=0.02, abs=1e-3)


def test_the_table_of_studies_is_that_of_the_verdicts() -> None:
    spec = importlib.util.spec_from_file_location(
        "results_table", ROOT / "benchmarks/results_table.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    page = (RESULTS / "README.md").read_text(encoding="utf-8")
    assert module.renewed(page, RESULTS) == page
    assert [line.split()[1] for line in page.splitlines() if line.startswith("| E")] == list(
        STUDIES
    )


def test_a_table_is_read_back_as_it_was(tmp_path: Path) -> None:
    rows = [
        Row({"x": 1, "name": "a"}, 0, {"y": 0.1, "found": True, "path": [1, 2]}, None, 0.5),
        Row({"x": 1, "name": "1999"}, 1, {"y": None, "found": False, "path": []}, None, 0.5),
        Row({"x": 2, "name": "a"}, 0, None, "ValueError: no", 0.5),
    ]
    path = tmp_path / "table.csv"
    path.write_text(Table(rows).to_csv(), encoding="utf-8")
    read = read_csv(path, {"x": (1, 2), "name": ("a", "1999")})
    assert list(read.rows) == rows
