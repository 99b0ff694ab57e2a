"""`mcloc study`: what a user sees, and what is left when a study is interrupted."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from .conftest import Mcloc


@pytest.fixture(autouse=True)
def no_data(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody has the recorded logs."""
    monkeypatch.delenv("MCLOC_DATA", raising=False)


def test_list_names_studies_and_what_is_missing(mcloc: Mcloc) -> None:
    done = mcloc("study", "list")
    assert done.code == 0
    assert "E5   How many samples under real-time conditions" in done.stdout
    assert "50 settings × 30 seeds, 2 claims" in done.stdout
    assert "20 settings cannot be run here: MCLOC_DATA does not name the folder" in done.stdout


def test_list_as_json(mcloc: Mcloc) -> None:
    listed = json.loads(mcloc("study", "list", "--json").stdout)
    assert {"E1", "E2", "E3", "E5", "E14"} <= {study["study"] for study in listed}
    assert all(study["claims"] > 0 for study in listed)


@pytest.mark.parametrize("name", ["E1", "e1", "e01", "1"])
def test_a_study_runs_and_tells_its_verdicts(mcloc: Mcloc, tmp_path: Path, name: str) -> None:
    done = mcloc("study", "run", name, "--runs", 2, "--jobs", 1, "--out", tmp_path)
    assert (done.code, done.stderr) == (0, "")
    assert done.stdout.startswith("E1: ")
    assert "reproduced" in done.stdout
    assert "seeds: too few to rely on" in done.stdout
    assert f"results: {tmp_path / 'e01' / 'study.md'}" in done.stdout
    assert {path.name for path in (tmp_path / "e01").iterdir()} >= {
        *("journal.jsonl", "table.csv", "verdict.json", "figure.png", "study.md"),
    }


def test_verdicts_as_json(mcloc: Mcloc, tmp_path: Path) -> None:
    done = mcloc("study", "run", "E1", "--runs", 2, "--jobs", 1, "--out", tmp_path, "--json")
    (verdict,) = json.loads(done.stdout)
    assert verdict["study"] == "E1"
    assert verdict == json.loads((tmp_path / "e01" / "verdict.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["77"], "unknown study '77'; known: E1, "),
        (["cat"], "unknown study 'cat'; known: E1, "),
        (["E1", "e01"], "a study is named twice: E1 e01"),
        (["E1", "--runs", 0], "--runs: at least one run for each setting, got 0"),
        (["E1", "--jobs", 0], "--jobs is a number of processes >= 1, or -1"),
        (["E1", "--out", "/dev/null/x"], "--out /dev/null/x/e01: no folder to write to"),
    ],
)
def test_wrong_input_is_told_in_one_line(
    mcloc: Mcloc, tmp_path: Path, arguments: list[object], message: str
) -> None:
    done = mcloc("study", "run", "--out", tmp_path, *arguments)
    assert done.code == 2
    assert done.stderr.startswith(f"error: {message}")
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == [] or arguments[1] == "--jobs"


def test_a_second_run_does_not_overwrite_the_first(mcloc: Mcloc, tmp_path: Path) -> None:
    run = ("study", "run", "E1", "--runs", 1, "--jobs", 1, "--out", tmp_path)
    assert mcloc(*run).code == 0
    again = mcloc(*run)
    assert again.code == 2
    assert "go on with them by --resume, or give another --out" in again.stderr
    assert mcloc(*run, "--resume").code == 0


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_ctrl_c_leaves_what_was_made_and_resume_goes_on(
    mcloc: Mcloc, tmp_path: Path, jobs: int
) -> None:
    run = ["study", "run", "E5", "--runs", "1", "--out", str(tmp_path), "--jobs", str(jobs)]
    journal = tmp_path / "e05" / "journal.jsonl"
    process = subprocess.Popen(
        [str(Path(sys.executable).parent / "mcloc"), *run],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # Where the tests run in the background, Ctrl-C is ignored, and by what they start, too.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    until = time.monotonic() + 240.0
    while time.monotonic() < until:
        if journal.exists() and journal.read_bytes().count(b"\n") > 3:
            break
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all processes
    stdout, stderr = process.communicate(timeout=120.0)
    assert process.returncode == 130
    assert stdout == ""
    assert "of 30 runs are in" in stderr
    assert stderr.endswith("--resume goes on\ninterrupted\n")
    assert "Traceback" not in stderr
    before = journal.read_text(encoding="utf-8").splitlines()
    assert 3 < len(before) < 31
    table = (tmp_path / "e05" / "table.csv").read_text(encoding="utf-8").splitlines()
    assert len(table) == len(before)
    assert mcloc(*run, "--resume").code == 0
    after = journal.read_text(encoding="utf-8").splitlines()
    assert after[: len(before)] == before
    assert len(after) == 31
