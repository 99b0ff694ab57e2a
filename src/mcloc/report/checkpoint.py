"""A run that is saved while it goes on, and gone on with where it was saved."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from mcloc.config import RunConfig, checked
from mcloc.config.yaml_file import parse_yaml
from mcloc.errors import StateError
from mcloc.localizer.state import packed, unpacked
from mcloc.report.run import Run
from mcloc.storage import read_state, write_state

VERSION = 4
NAME = "checkpoint.npz"

_TABLES = ("rows", "updates", "withheld", "sighted", "sizes")


class Checkpoints:
    """Saves a run whenever `every` seconds of wall time have passed, at first at once."""

    def __init__(self, path: Path, every: float) -> None:
        self.path, self.every = path, every
        self._saved = -float("inf")

    def note(self, run: Run) -> None:
        """Save the run if it is time; between two events."""
        if time.monotonic() - self._saved >= self.every:
            self.save(run)

    def save(self, run: Run) -> None:
        """Save the run now, whole or not at all. Raises ConfigError where that cannot be done."""
        values, arrays = packed(run.localizer)
        arrays |= {f"history.{name}": getattr(run.history, name).table for name in _TABLES}
        about = {
            "version": VERSION,
            "every": self.every,
            "config": run.config.to_yaml(),
            "consumed": run.consumed,
            "last_event": run.read,
            "wall_time": run.wall_time,
            "localizer": values,
        }
        write_state(self.path, about, arrays)
        self._saved = time.monotonic()


def saved_config(path: Path) -> tuple[RunConfig, float]:
    """The config of a saved run, and every how many seconds it was saved. Raises StateError."""
    values, _ = read_state(path, VERSION)
    return _config(path, values), values["every"]


def resume(path: Path, threads: int | None = None) -> Run:
    """The run that was saved: iterate over it to go on. threads: instead of those that it had.

    Raises StateError for a file that is damaged, and what Run raises.
    """
    values, arrays = read_state(path, VERSION)
    config = _config(path, values)
    run = Run(config if threads is None else replace(config, threads=threads))
    try:
        tables = {name: arrays.pop(f"history.{name}") for name in _TABLES}
        run.consumed, run.wall_time = values["consumed"], values["wall_time"]
        run.last_event = values["last_event"]
        localizer = values["localizer"]
    except KeyError as cause:
        raise StateError(f"{path}: damaged, or no saved run ({cause} is missing)") from cause
    run.localizer = unpacked(str(path), localizer, arrays, run.grid, run.aids)
    run.history.sizes = type(run.history.sizes)(run.history.sizes.width)
    for name, table in tables.items():
        getattr(run.history, name).extend(table)
    return run


def _config(path: Path, values: dict[str, Any]) -> RunConfig:
    try:
        entries = checked(str(path), parse_yaml(str(path), values["config"]))
        return RunConfig(**{"map": None, **entries})
    except KeyError as cause:
        raise StateError(f"{path}: damaged, or no saved run ({cause} is missing)") from cause
