"""Which events of a log a run takes, and what its history keeps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mcloc.cli.story import told
from mcloc.config import RunConfig
from mcloc.report import Run
from mcloc.report.summary import summarize
from mcloc.simulation import office_drive, write_drive


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


def test_a_filter_that_withholds_its_estimate_at_the_end(config: RunConfig) -> None:
    run = Run(replace(config, end=3.0))
    stamps(run)
    run.localizer.hypotheses = ()
    summary = summarize(run, None)
    assert summary["final"] == {"x": None, "y": None, "theta": None, "hypotheses": []}
    assert "final pose none: the filter withholds" in told(summary, Path("run"), [])
