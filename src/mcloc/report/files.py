"""A run as files in a folder. Each appears whole or not at all."""

import os
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from mcloc.config import RunConfig
from mcloc.config.typed import check_path
from mcloc.errors import ConfigError, TruthError
from mcloc.io.tum import write_tum
from mcloc.report.picture import draw
from mcloc.report.run import Run
from mcloc.report.summary import accuracy_of, summarize, to_json
from mcloc.sample_size import sizes_csv
from mcloc.storage import replacing

SIZES = "sizes.csv"
WRITTEN = (
    *("estimates.csv", "timing.csv", "summary.json", "config.yaml", "trajectory.tum"),
    *("run.png", "run.gif", "recording", SIZES),
)
"""What a run replaces in its folder."""


def check_folder(folder: Path, inputs: Iterable[str | None] = ()) -> None:
    """Make the folder, and make sure that files can be put there.

    inputs: paths that a run reads, None for none. Raises ConfigError, also where the run's files
    would take the place of an input.
    """
    check_path("--out", str(folder))
    written = {Path(os.path.realpath(folder), name) for name in WRITTEN}
    for path in filter(None, inputs):
        real = Path(os.path.realpath(path))
        if not written.isdisjoint((real, *real.parents)):
            raise ConfigError(f"--out {folder}: {path} would be replaced; give another folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except FileExistsError as cause:
        raise ConfigError(f"--out {folder}: is a file; give a folder") from cause
    except OSError as cause:
        raise ConfigError(f"--out {folder}: no folder to write to ({cause.strerror})") from cause


def write_run(run: Run, folder: Path, plot: bool = True) -> dict[str, Any]:
    """Write all files of a run with at least one estimate; the summary.

    Pictures of an earlier run that are not drawn anew are removed. Raises ConfigError where a file
    cannot be written; TruthError, once everything is written, where the truth says nothing about
    the run.
    """
    accuracy, useless = None, None
    try:
        accuracy = accuracy_of(run)
    except TruthError as cause:
        useless = cause
    summary = summarize(run, accuracy)
    _write(folder / "estimates.csv", run.history.estimates_csv())
    _write(folder / "timing.csv", run.history.timing_csv())
    with replacing(folder / "summary.json") as path:
        path.write_text(to_json(summary), encoding="utf-8")
    with replacing(folder / "trajectory.tum") as path:
        write_tum(run.history.trajectory, path)
    _write_config(run, folder)
    (folder / "run.gif").unlink(missing_ok=True)
    if plot:
        with replacing(folder / "run.png") as path:
            draw(run, path)
    else:
        (folder / "run.png").unlink(missing_ok=True)
    if useless is not None:
        raise TruthError(f"{run.config.truth or run.config.log}: {useless}")
    return summary


def _write_config(run: Run, folder: Path) -> None:
    """The config that repeats the run: with the sizes that it had, where the clock chose them."""
    config: RunConfig = run.config
    if config.size == "time-budget":
        with replacing(folder / SIZES) as path:
            path.write_text(sizes_csv(run.history.sizes.table), encoding="utf-8")
        settings = {**config.settings, "size": {"file": str(folder / SIZES)}}
        config = replace(config, size="recorded", settings=settings)
    elif config.size != "recorded":  # whose sizes may be those
        (folder / SIZES).unlink(missing_ok=True)
    with replacing(folder / "config.yaml") as path:
        path.write_text(config.to_yaml(), encoding="utf-8")


def _write(file: Path, lines: Iterator[str]) -> None:
    with replacing(file) as path, path.open("w", encoding="utf-8") as stream:
        stream.writelines(f"{line}\n" for line in lines)
