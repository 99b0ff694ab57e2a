"""`--checkpoint-every` and `--resume`: killed at any moment, a run ends with the same bytes."""

import random
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from tests.cli.conftest import Mcloc

from mcloc.report.checkpoint import NAME, VERSION, saved_config
from mcloc.simulation import office_drive, write_drive
from mcloc.storage import read_state

SAME = ("estimates.csv", "trajectory.tum", "config.yaml")
KILLS = 50


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drive")
    write_drive(office_drive(seed=1, length=40.0), folder, format="carmen")
    return folder


def arguments(folder: Path, out: Path) -> list[str]:
    """Of a run that is saved as often as it can be; 4 s of computing on one thread."""
    return [
        *("run", "--map", str(folder / "map.yaml"), "--log", str(folder / "log.gz"), "--no-plot"),
        *("--seed", "4", "--size", "fixed", "--particles", "20000", "--threads", "1"),
        *("--checkpoint-every", "0s", "--out", str(out)),
    ]


def start(arguments: list[str]) -> subprocess.Popen[bytes]:
    program = [sys.executable, "-c", "from mcloc.cli.main import main; main()"]
    return subprocess.Popen([*program, *arguments], stdout=subprocess.DEVNULL)


def files(out: Path) -> dict[str, bytes]:
    """config.yaml names no folder, so that it can be compared."""
    return {name: (out / name).read_bytes() for name in SAME}


@pytest.mark.slow
def test_killed_at_random_moments(folder: Path, tmp_path: Path) -> None:
    whole, out = tmp_path / "whole", tmp_path / "out"
    assert start(arguments(folder, whole)).wait() == 0
    expected, moments, kills, consumed = files(whole), random.Random(1), 0, 0
    while kills < KILLS:
        saved = (out / NAME).exists()
        options = ["run", "--resume", "--out", str(out)] if saved else arguments(folder, out)
        process = start(options)
        try:
            assert process.wait(moments.uniform(0.2, 3.0)) == 0
            assert files(out) == expected
            shutil.rmtree(out)
            consumed = 0
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            kills += 1
            if (out / NAME).exists():
                reached = read_state(out / NAME, VERSION)[0]["consumed"]
                assert reached >= consumed
                consumed = reached
    assert start([*arguments(folder, out), "--resume"]).wait() == 0
    assert files(out) == expected


@pytest.fixture(scope="module")
def saved(drive: Path, mcloc: Mcloc, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that was saved."""
    out = tmp_path_factory.mktemp("saved") / "out"
    done = mcloc(
        *("run", "--map", drive / "map.yaml", "--log", drive / "log.gz", "--no-plot"),
        *("--end", 5, "--checkpoint-every", "5m", "--out", out),
    )
    assert done.code == 0, done.stderr
    return out


def test_resume_needs_the_folder_alone(saved: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    before = files(saved)
    done = mcloc("run", "--resume", "--out", saved, "--no-plot")
    assert done.code == 0, done.stderr
    assert files(saved) == before
    assert saved_config(saved / NAME)[1] == 300.0


def test_options_that_are_those_of_the_saved_run_may_be_repeated(
    saved: Path, drive: Path, mcloc: Mcloc
) -> None:
    done = mcloc(
        *("run", "--resume", "--out", saved, "--no-plot", "--map", drive / "map.yaml"),
        *("--log", drive / "log.gz", "--end", 5, "--threads", 2),
    )
    assert done.code == 0, done.stderr


@pytest.mark.parametrize(
    ("option", "value", "named"),
    [
        ("--seed", "1", "seed"),
        ("--size", "fixed", "size"),
        ("--end", "6", "end"),
        ("--pace", "modelled", "pace"),
    ],
)
def test_another_run_is_not_resumed(
    saved: Path, mcloc: Mcloc, option: str, value: str, named: str
) -> None:
    done = mcloc("run", "--resume", "--out", saved, option, value)
    assert done.code == 2
    assert f"was made with {named} = " in done.stderr
    assert len(done.stderr.splitlines()) <= 2


def test_nothing_to_resume(drive: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    done = mcloc("run", "--resume", "--out", tmp_path / "none")
    assert done.code == 2
    assert "no run was saved in" in done.stderr
    done = mcloc(
        *("run", "--resume", "--map", drive / "map.yaml", "--log", drive / "log.gz"),
        *("--end", 3, "--no-plot", "--out", tmp_path / "new"),
    )
    assert done.code == 0
    assert "starting from its beginning" in done.stderr


def test_a_damaged_checkpoint(mcloc: Mcloc, tmp_path: Path) -> None:
    (tmp_path / NAME).write_bytes(b"PK\x03\x04 no more")
    done = mcloc("run", "--resume", "--out", tmp_path)
    assert done.code == 2
    assert done.stderr.startswith(f"error: {tmp_path / NAME}: damaged")


@pytest.mark.parametrize("time", ["soon", "-1s", "", "5 parsecs", "nan", "infh"])
def test_an_interval_that_is_none(drive: Path, mcloc: Mcloc, tmp_path: Path, time: str) -> None:
    done = mcloc(
        *("run", "--map", drive / "map.yaml", "--log", drive / "log.gz", "--out", tmp_path),
        f"--checkpoint-every={time}",
    )
    assert done.code == 2
    assert "--checkpoint-every takes a time such as 90s" in done.stderr
