"""Files that appear whole or not at all."""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from mcloc.config import RunConfig, read_entries
from mcloc.errors import ConfigError
from mcloc.report import Run, check_folder, write_run
from mcloc.simulation import office_drive, write_drive


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run over the first seconds of a drive."""
    folder = tmp_path_factory.mktemp("drive")
    write_drive(office_drive(seed=1, length=5.0), folder)
    run = Run(RunConfig(f"{folder}/map.yaml", f"{folder}/log.gz", seed=1, end=2.0))
    for _ in run:
        pass
    return run


def test_a_file_that_cannot_be_written_leaves_nothing_half_done(run: Run, tmp_path: Path) -> None:
    (tmp_path / "summary.json").mkdir()
    with pytest.raises(ConfigError, match=r"summary\.json"):
        write_run(run, tmp_path, plot=False)
    assert not [path for path in tmp_path.iterdir() if path.name.endswith(".unfinished")]


def test_the_picture_is_the_same_each_time(run: Run, tmp_path: Path) -> None:
    pictures = []
    for name in "ab":
        (tmp_path / name).mkdir()
        write_run(run, tmp_path / name)
        pictures.append((tmp_path / name / "run.png").read_bytes())
    assert pictures[0] == pictures[1]


def test_a_picture_of_an_earlier_run_does_not_stay(run: Run, tmp_path: Path) -> None:
    (tmp_path / "run.png").write_text("old")
    write_run(run, tmp_path, plot=False)
    assert not (tmp_path / "run.png").exists()


def test_a_film_of_an_earlier_run_does_not_stay(run: Run, tmp_path: Path) -> None:
    (tmp_path / "run.gif").write_text("old")
    write_run(run, tmp_path)
    assert not (tmp_path / "run.gif").exists()


def test_sizes_stay_as_long_as_the_config_names_them(run: Run, tmp_path: Path) -> None:
    """Repeated in its own folder, a run on the clock must not lose the sizes that repeat it."""
    budget = Run(replace(run.config, size="time-budget", settings={}))
    for _ in budget:
        pass
    write_run(budget, tmp_path, plot=False)
    sizes = (tmp_path / "sizes.csv").read_bytes()
    for _ in range(2):
        again = Run(RunConfig(**read_entries(tmp_path / "config.yaml")))
        assert again.config.size == "recorded"
        for _ in again:
            pass
        write_run(again, tmp_path, plot=False)
        assert (tmp_path / "sizes.csv").read_bytes() == sizes
    write_run(run, tmp_path, plot=False)
    assert not (tmp_path / "sizes.csv").exists()


@pytest.mark.parametrize("name", ["estimates.csv", "trajectory.tum", "recording/recording_0.mcap"])
def test_no_input_is_replaced(name: str, tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "out" / name)
    out = tmp_path / "a" / ".." / "out"
    for given in (f"{tmp_path}/out/{name}", f"{tmp_path}/link"):
        with pytest.raises(ConfigError, match=f"{given} would be replaced; give another folder"):
            check_folder(out, ["map.yaml", None, given])
    check_folder(tmp_path / "other", ["map.yaml", None, f"{tmp_path}/out/{name}"])
    check_folder(tmp_path / "out", [f"{tmp_path}/out/truth.csv"])


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ConfigError, match="file: is a file; give a folder"):
        check_folder(tmp_path / "file")


def test_a_folder_that_no_config_could_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"--out must be a name in UTF-8, got '.*\\udcff'"):
        check_folder(tmp_path / os.fsdecode(b"\xff"))
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_made(tmp_path: Path) -> None:
    check_folder(tmp_path / "a" / "b")
    assert list((tmp_path / "a" / "b").iterdir()) == []
