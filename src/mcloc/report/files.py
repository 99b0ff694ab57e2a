"""A run as files in a folder. Each appears whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mcloc.errors import ConfigError, TruthError
from mcloc.io.tum import write_tum
from mcloc.report.picture import draw
from mcloc.report.run import Run
from mcloc.report.summary import accuracy_of, summarize, to_json
from mcloc.report.tables import estimates_csv, timing_csv, trajectory_of


def check_folder(folder: Path) -> None:
    """Make the folder, and make sure that files can be put there. Raises ConfigError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as cause:
        raise ConfigError(f"--out {folder}: no folder to write to ({cause.strerror})") from cause


def write_run(run: Run, folder: Path, plot: bool = True) -> dict[str, Any]:
    """Write all files of a run with at least one estimate; the summary.

    Without `plot` an earlier run's picture is removed. Raises ConfigError where a file cannot be
    written; TruthError, once everything is written, where the truth says nothing about the run.
    """
    accuracy, useless = None, None
    try:
        accuracy = accuracy_of(run)
    except TruthError as cause:
        useless = cause
    summary = summarize(run, accuracy)
    texts = {
        "estimates.csv": estimates_csv(run.estimates),
        "timing.csv": timing_csv(run.estimates),
        "summary.json": to_json(summary),
        "config.yaml": run.config.to_yaml(),
    }
    for name, text in texts.items():
        with _replacing(folder / name) as path:
            path.write_text(text, encoding="utf-8")
    with _replacing(folder / "trajectory.tum") as path:
        write_tum(trajectory_of(run.estimates), path)
    if plot:
        with _replacing(folder / "run.png") as path:
            draw(run, path)
    else:
        (folder / "run.png").unlink(missing_ok=True)
    if useless is not None:
        raise TruthError(f"{run.config.truth}: {useless}")
    return summary


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """Somewhere to write what then takes the place of `path`."""
    unfinished = path.with_name(f".{path.name}.unfinished")
    try:
        yield unfinished
        os.replace(unfinished, path)
    except OSError as cause:
        raise ConfigError(f"{path}: cannot be written ({cause.strerror})") from cause
    finally:
        unfinished.unlink(missing_ok=True)
