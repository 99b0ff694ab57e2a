"""A run that is saved and gone on with gives the same files."""

from dataclasses import replace
from pathlib import Path

import pytest

from mcloc.config import RunConfig, read_entries
from mcloc.errors import StateError
from mcloc.report import Run, write_run
from mcloc.report.checkpoint import NAME, VERSION, Checkpoints, resume, saved_config
from mcloc.simulation import office_drive, write_drive
from mcloc.storage import read_state, write_state

SAME = ("estimates.csv", "trajectory.tum", "config.yaml")


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> RunConfig:
    folder = tmp_path_factory.mktemp("drive")
    write_drive(office_drive(seed=1, length=8.0), folder, format="carmen")
    return RunConfig(
        f"{folder}/map.yaml", f"{folder}/log.gz", f"{folder}/truth.csv", seed=3, start=1.0, end=12.0
    )


def finished(run: Run, folder: Path) -> dict[str, bytes]:
    """The files of a run that is made to its end, those that tell no times."""
    for _ in run:
        pass
    folder.mkdir(exist_ok=True)
    write_run(run, folder, plot=False)
    return {name: (folder / name).read_bytes() for name in SAME}


@pytest.mark.parametrize("stop", [1, 40, 150])
def test_resumed_after_any_event_it_writes_the_same_files(
    config: RunConfig, tmp_path: Path, stop: int
) -> None:
    expected = finished(Run(config), tmp_path / "whole")
    saves = Checkpoints(tmp_path / NAME, every=0.0)
    run = Run(config)
    for _, _ in zip(range(stop), run.by_event(), strict=False):
        saves.note(run)
    again = resume(tmp_path / NAME)
    assert again.consumed == stop
    assert again.config == run.config
    assert again.wall_time > 0.0
    assert finished(again, tmp_path / "resumed") == expected


def test_a_run_that_loses_scans_is_gone_on_with_too(config: RunConfig, tmp_path: Path) -> None:
    slow = replace(config, pace="modelled", settings={"pace": {"particle_beam": 1e-5}})
    whole = Run(slow)
    expected = finished(whole, tmp_path / "whole")
    assert whole.ignored["scan while the filter was busy"] > 3
    saves, run = Checkpoints(tmp_path / NAME, every=0.0), Run(slow)
    for _, _ in zip(range(90), run.by_event(), strict=False):
        saves.note(run)
    again = resume(tmp_path / NAME)
    assert finished(again, tmp_path / "resumed") == expected
    assert again.ignored == whole.ignored


def test_a_finished_run_can_be_resumed_too(config: RunConfig, tmp_path: Path) -> None:
    run = Run(config)
    expected = finished(run, tmp_path / "whole")
    Checkpoints(tmp_path / NAME, every=60.0).save(run)
    assert finished(resume(tmp_path / NAME), tmp_path / "resumed") == expected


def test_sizes_that_the_clock_chose_are_saved_and_repeated(
    config: RunConfig, tmp_path: Path
) -> None:
    """Saved, resumed, then repeated by the config.yaml that was written."""
    timed = replace(config, size="time-budget", settings={"size": {"maximum": 4000}})
    saves = Checkpoints(tmp_path / NAME, every=0.0)
    run = Run(timed)
    for _, _ in zip(range(60), run.by_event(), strict=False):
        saves.note(run)
    first = finished(resume(tmp_path / NAME), tmp_path / "timed")
    written = RunConfig(**read_entries(tmp_path / "timed" / "config.yaml"))
    assert written.size == "recorded"
    repeated = finished(Run(written), tmp_path / "repeated")
    assert repeated["estimates.csv"] == first["estimates.csv"]


def test_saved_at_first_and_then_when_it_is_time(
    config: RunConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 0.0
    monkeypatch.setattr("mcloc.report.checkpoint.time.monotonic", lambda: now)
    saves, run, saved = Checkpoints(tmp_path / NAME, every=60.0), Run(config), []
    for seconds in (0.0, 30.0, 59.0, 60.0, 61.0, 120.0):
        now = seconds
        saves.note(run)
        if (tmp_path / NAME).exists():
            (tmp_path / NAME).unlink()
            saved.append(seconds)
    assert saved == [0.0, 60.0, 120.0]


def test_the_interval_is_kept(config: RunConfig, tmp_path: Path) -> None:
    Checkpoints(tmp_path / NAME, every=12.5).save(Run(config))
    stored, every = saved_config(tmp_path / NAME)
    assert every == 12.5
    assert stored == config.resolved()


def test_a_log_that_got_shorter(config: RunConfig, tmp_path: Path) -> None:
    run = Run(config)
    run.consumed = 10**6
    Checkpoints(tmp_path / NAME, every=0.0).save(run)
    with pytest.raises(StateError, match=r"ends after \d+ events, .* is it the same log\?"):
        list(resume(tmp_path / NAME))


def test_another_log_is_not_gone_on_with(config: RunConfig, tmp_path: Path) -> None:
    """Of the same length and name, but of another drive."""
    drive, saves = Path(config.log).parent, Checkpoints(tmp_path / NAME, every=0.0)
    copy = tmp_path / "log.gz"
    copy.write_bytes((drive / "log.gz").read_bytes())
    run = Run(replace(config, log=str(copy)))
    for _, _ in zip(range(50), run.by_event(), strict=False):
        saves.note(run)
    write_drive(office_drive(seed=2, length=8.0), tmp_path / "other", format="carmen")
    copy.write_bytes((tmp_path / "other" / "log.gz").read_bytes())
    with pytest.raises(StateError, match=r"is not what the run .* is it the same log"):
        list(resume(tmp_path / NAME))


@pytest.mark.parametrize(
    "missing", ["config", "consumed", "last_event", "localizer", "history.rows"]
)
def test_a_checkpoint_without_a_part(config: RunConfig, tmp_path: Path, missing: str) -> None:
    Checkpoints(tmp_path / NAME, every=0.0).save(Run(config))
    values, arrays = read_state(tmp_path / NAME, VERSION)
    (arrays if missing.startswith("history") else values).pop(missing)
    write_state(tmp_path / NAME, values, arrays)
    with pytest.raises(StateError, match=f"{NAME}: damaged, or no saved run"):
        resume(tmp_path / NAME)
