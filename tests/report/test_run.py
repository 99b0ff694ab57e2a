"""Which events of a log a run takes, and what its history keeps."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcloc.cli.story import told
from mcloc.config import RunConfig
from mcloc.errors import LogError
from mcloc.evaluation import evaluate
from mcloc.report import Run, accuracy_of, write_run
from mcloc.report.checkpoint import NAME, Checkpoints, resume
from mcloc.report.summary import summarize
from mcloc.simulation import Scenario, office_drive, office_world, simulate, write_drive

WITHHELD = "scan while the filter withheld its estimate"


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> RunConfig:
    folder = tmp_path_factory.mktemp("drive")
    write_drive(office_drive(seed=1, length=8.0), folder, format="carmen")
    return RunConfig(f"{folder}/map.yaml", f"{folder}/log.gz", seed=3)


def stamps(run: Run) -> np.ndarray:
    for _ in run:
        pass
    return run.history.column("t")


def spoilt(run: Run, number: int, shift: float) -> Run:
    """The run, with a wrong stamp for one event of its log."""
    events = list(run.log)
    events[number] = replace(events[number], t=events[number].t + shift)
    run.log = type("Spoilt", (list,), {"skipped": {}})(events)
    return run


def test_the_part_that_was_asked_for(config: RunConfig) -> None:
    t = stamps(Run(replace(config, start=2.0, end=6.0)))
    assert 2.0 <= t[0] < 2.3
    assert 5.7 < t[-1] <= 6.0


def test_one_stamp_beyond_the_end_does_not_end_it(config: RunConfig) -> None:
    expected = stamps(Run(replace(config, end=6.0)))
    t = stamps(spoilt(Run(replace(config, end=6.0)), 30, 60.0))
    assert set(t) <= set(expected)
    assert len(t) >= len(expected) - 1


def test_where_the_clock_is_set_back_stamps_still_increase(config: RunConfig) -> None:
    run = Run(config)
    events = list(run.log)
    back = [replace(e, t=e.t - (20.0 if k > 100 else 0.0)) for k, e in enumerate(events)]
    run.log = type("Back", (list,), {"skipped": {}})(back)
    t = stamps(run)
    assert (np.diff(t) > 0.0).all()
    assert t[-1] == pytest.approx(max(e.t for e in back[101:]), abs=0.3)
    assert run.ignored["clock of scans set back"] == 1


# A filter that withholds its estimate


@pytest.fixture(scope="module")
def searching(tmp_path_factory: pytest.TempPathFactory) -> RunConfig:
    """The robot is carried off at 12 s. No pose is told before 7.6 s, and from 15.2 to 18 s."""
    folder = tmp_path_factory.mktemp("kidnapped")
    drive = simulate(office_world(2), 2, Scenario(length=14.0, kidnap_at=(12.0,)))
    write_drive(drive, folder, format="carmen")
    config = RunConfig(f"{folder}/map.yaml", f"{folder}/log.gz", f"{folder}/truth.csv", seed=3)
    return withholding(config, 0.3)


def withholding(config: RunConfig, collapsed: float) -> RunConfig:
    settings = {"filter": {"collapsed": collapsed}}
    return replace(config, filter="grid-proposal", settings=settings)


def test_scans_without_a_pose_are_part_of_the_run(searching: RunConfig) -> None:
    run, full = Run(searching), Run(replace(searching, filter="mcl", settings={}))
    t, every = stamps(run), stamps(full)
    silent = run.history.withheld.table[:, 0]
    assert len(silent) == run.ignored[WITHHELD] > 40
    assert np.array_equal(np.sort(np.concatenate([t, silent])), every)
    assert run.history.wheels.t.tolist() == every.tolist()
    assert np.array_equal(run.history.wheels.poses, full.history.wheels.poses)
    ours, theirs = (summarize(r, accuracy_of(r)) for r in (run, full))
    assert ours["withheld"] == pytest.approx(len(silent) / len(every))
    assert theirs["withheld"] == 0.0
    for name in ("duration_s", "distance_m"):
        assert ours[name] == theirs[name]


def test_converging_takes_from_the_first_scan_on(tmp_path: Path) -> None:
    write_drive(simulate(office_world(2), 2, Scenario(length=14.0)), tmp_path, format="carmen")
    paths = (f"{tmp_path}/{name}" for name in ("map.yaml", "log.gz", "truth.csv"))
    run = Run(withholding(RunConfig(*paths, seed=3), 0.3))
    t, truth = stamps(run), run.truth
    assert truth is not None
    accuracy = accuracy_of(run)
    assert accuracy is not None
    first, found = np.searchsorted(truth.t, [run.history.wheels.t[0] - 1e-3, t[0] - 1e-3])
    assert t[0] > 3.0
    assert accuracy.time_to_converge_s == pytest.approx(truth.t[found] - truth.t[first])
    steps = np.hypot(*np.diff(truth.poses[first : found + 1, :2], axis=0).T)
    assert accuracy.distance_to_converge_m == pytest.approx(steps.sum())
    assert steps.sum() > 1.0
    blind = evaluate(run.history.trajectory, truth, odometry=run.history.wheels)
    assert (blind.time_to_converge_s, blind.distance_to_converge_m) == (0.0, 0.0)
    assert accuracy.position_median_m == blind.position_median_m


def test_a_filter_that_withholds_its_estimate_at_the_end(
    searching: RunConfig, tmp_path: Path
) -> None:
    run = Run(replace(searching, end=17.0))
    t = stamps(run)
    assert t[-1] < 15.2
    summary: dict[str, Any] = write_run(run, tmp_path)  # with its picture
    assert (tmp_path / "run.png").stat().st_size > 0
    assert summary["final"] == {"x": None, "y": None, "theta": None, "hypotheses": []}
    assert summary["duration_s"] > 16.5
    assert not summary["accuracy"]["converged"]
    (kidnapped,) = summary["accuracy"]["recoveries"]
    assert kidnapped["t"] == pytest.approx(12.0, abs=0.3)
    assert not kidnapped["recovered"]
    story = told(summary, Path("run"), [])
    assert "final pose none: the filter withholds" in story
    share = f"{100.0 * summary['withheld']:.0f}"
    assert f"withheld   the estimate at {share} % of the scans; errors are" in story


def test_a_filter_that_never_tells_a_pose_is_named_as_the_cause(searching: RunConfig) -> None:
    run = Run(replace(withholding(searching, 1e-3), end=3.0))
    with pytest.raises(LogError, match=r"withheld its estimate at all \d+ scans up to end = 3 s: "):
        stamps(run)


def test_a_resumed_run_knows_which_scans_had_no_pose(searching: RunConfig, tmp_path: Path) -> None:
    whole = Run(searching)
    stamps(whole)
    run, saves = Run(searching), Checkpoints(tmp_path / NAME, every=0.0)
    for _, _ in zip(range(90), run.by_event(), strict=False):
        saves.note(run)
    again = resume(tmp_path / NAME)
    assert 0 < len(again.history.withheld) < len(whole.history.withheld)
    stamps(again)
    assert np.array_equal(again.history.withheld.table, whole.history.withheld.table)
    assert accuracy_of(again) == accuracy_of(whole)


def test_where_the_clock_is_set_back_withheld_stamps_still_increase(searching: RunConfig) -> None:
    run = Run(searching)
    events = list(run.log)
    back = [replace(e, t=e.t - (20.0 if k > 60 else 0.0)) for k, e in enumerate(events)]
    run.log = type("Back", (list,), {"skipped": {}})(back)
    stamps(run)
    assert (np.diff(run.history.withheld.table[:, 0]) > 0.0).all()
    assert (np.diff(run.history.wheels.t) > 0.0).all()
