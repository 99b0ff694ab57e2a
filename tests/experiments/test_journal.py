"""What is in the journal is never lost, never doubled, and never of another study."""

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mcloc.errors import StateError
from mcloc.experiments.journal import Journal, key
from mcloc.experiments.table import Row

HEADER = {"study": "E99", "mcloc": "1", "fingerprint": "abc"}
ROWS = [Row({"x": k, "name": "α"}, 7, {"y": 0.1 * k}, None, 1.5) for k in range(3)]


def written(folder: Path, rows: list[Row] = ROWS) -> Path:
    with Journal(folder, HEADER, resume=False) as journal:
        for row in rows:
            journal.add(row)
    return journal.path


def test_rows_come_back_as_they_were(tmp_path: Path) -> None:
    written(tmp_path)
    with Journal(tmp_path, HEADER, resume=True) as journal:
        assert list(journal.rows.values()) == ROWS


def test_an_error_comes_back_too(tmp_path: Path) -> None:
    row = Row({"x": 1}, 0, None, "ValueError: bad", 0.1)
    written(tmp_path, [row])
    with Journal(tmp_path, HEADER, resume=True) as journal:
        assert list(journal.rows.values()) == [row]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(cut=st.integers(min_value=0, max_value=10_000), more=st.booleans())
def test_a_file_cut_anywhere_gives_its_whole_rows_and_takes_more(
    tmp_path: Path, cut: int, more: bool
) -> None:
    (tmp_path / "journal.jsonl").unlink(missing_ok=True)
    path = written(tmp_path)
    content = path.read_bytes()
    left = content[: min(cut, len(content))]
    path.write_bytes(left)
    whole = max(left.count(b"\n") - 1, 0)
    with Journal(tmp_path, HEADER, resume=True) as journal:
        assert list(journal.rows.values()) == ROWS[:whole]
        for row in ROWS if more else []:
            journal.add(row)
    with Journal(tmp_path, HEADER, resume=True) as journal:
        assert list(journal.rows.values()) == (ROWS if more else ROWS[:whole])
    lines = path.read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1 + (3 if more else whole)
    assert all(isinstance(json.loads(line), dict) for line in lines)


def test_a_row_that_is_there_is_not_added_again(tmp_path: Path) -> None:
    path = written(tmp_path, [ROWS[0], ROWS[0]])
    assert len(path.read_text(encoding="utf-8").splitlines()) == 2


def test_a_journal_is_not_overwritten(tmp_path: Path) -> None:
    path = written(tmp_path)
    before = path.read_bytes()
    with pytest.raises(StateError, match=r"holds 3 runs already; .* --resume, or give another"):
        Journal(tmp_path, HEADER, resume=False)
    assert path.read_bytes() == before


@pytest.mark.parametrize("name", list(HEADER))
def test_rows_of_another_study_are_not_gone_on_with(tmp_path: Path, name: str) -> None:
    written(tmp_path)
    with pytest.raises(
        StateError, match=rf"begun with {name} .*, not other: .*; give another --out"
    ):
        Journal(tmp_path, {**HEADER, name: "other"}, resume=True)


@pytest.mark.parametrize("line", ["no json\n", "[1, 2]\n", '{"setting": {}}\n'])
def test_lines_that_are_no_rows_are_named(tmp_path: Path, line: str) -> None:
    path = written(tmp_path)
    with path.open("a") as file:
        file.write(line)
    with pytest.raises(StateError, match=r"journal\.jsonl: .*give another"):
        Journal(tmp_path, HEADER, resume=True)


def test_keys_tell_settings_and_seeds_apart() -> None:
    keys = {key({"a": a, "b": b}, s) for a in (1, "1", True) for b in (1, 2) for s in (0, 1)}
    assert len(keys) == 12
    assert key({"a": 1, "b": 2}, 0) == key({"b": 2, "a": 1}, 0)
