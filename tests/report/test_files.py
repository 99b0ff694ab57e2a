"""Files that appear whole or not at all."""

from pathlib import Path

import pytest

from mcloc.config import RunConfig
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


def test_a_folder_is_made(tmp_path: Path) -> None:
    check_folder(tmp_path / "a" / "b")
    assert list((tmp_path / "a" / "b").iterdir()) == []
