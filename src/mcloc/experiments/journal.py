"""An append-only journal of a study, in JSON lines: a run that is in it is never made again.

The first line says which study it is of, each further one is a row. A line that was cut off by a
crash is no row; it is overwritten.
"""

import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any

from mcloc.errors import ConfigError, StateError
from mcloc.experiments.table import Row, Setting

NAME = "journal.jsonl"
OTHER = {
    "base": "other settings",
    "inputs": "other input files, or they have changed since",
}
"""What differs, where the values themselves say little."""


def key(setting: Setting, seed: int) -> str:
    """What tells one run of a study from another."""
    return json.dumps([sorted(setting.items()), seed])


class Journal:
    """The rows of a study in a file of a folder, which nobody else writes meanwhile.

    header: what must be the same for rows to be of one study. resume: go on with what is there.
    Raises StateError where there are rows and they are not to be gone on with, or are of another
    study, or another process is at work on them.
    """

    def __init__(self, folder: Path, header: Mapping[str, Any], resume: bool) -> None:
        self.path = folder / NAME
        self.header = dict(header)
        self.rows: dict[str, Row] = {}
        try:
            self._file: IO[str] = self.path.open("a", encoding="utf-8")
        except OSError as cause:
            raise self._unwritable(cause) from cause
        try:
            self._lock()
            whole = self._read(resume)
            self._file.truncate(whole)
            if whole == 0:
                self._write(self.header)
                self._save()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> "Journal":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let others have it."""
        self._file.close()

    def add(self, row: Row) -> None:
        """Take note of a row; it is on the disk when this returns. One that raised gives way to one
        that did not.
        """
        known = self.rows.get(key(row.setting, row.seed))
        if known is not None and known.record is not None:
            return
        self._write(
            {
                "setting": dict(row.setting),
                "seed": row.seed,
                "record": row.record,
                "error": row.error,
                "took_s": row.took,
            }
        )
        # An interrupt in the long wait for the disk finds it noted in both, or else in neither.
        self.rows[key(row.setting, row.seed)] = row
        self._save()

    def has(self, setting: Setting, seed: int) -> bool:
        """Whether a run was made; one that raised is made again."""
        row = self.rows.get(key(setting, seed))
        return row is not None and row.record is not None

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as cause:
            raise StateError(
                f"{self.path}: another mcloc is at work on it; wait for it, or give another --out"
            ) from cause

    def _unwritable(self, cause: OSError) -> ConfigError:
        return ConfigError(f"{self.path}: cannot be written ({cause.strerror})")

    def _write(self, entry: Mapping[str, Any]) -> None:
        try:
            self._file.write(json.dumps(entry, ensure_ascii=False, allow_nan=False) + "\n")
        except OSError as cause:
            raise self._unwritable(cause) from cause

    def _save(self) -> None:
        try:
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as cause:
            raise self._unwritable(cause) from cause

    def _read(self, resume: bool) -> int:
        """Take the rows in; how many bytes of the file are whole lines."""
        entries, whole = [], 0
        for entry, end in whole_lines(self.path):
            entries.append(entry)
            whole = end
        if len(entries) < 2:
            return 0  # nothing was made yet: this is the beginning
        if not resume:
            raise StateError(
                f"{self.path}: holds {len(entries) - 1} runs already; go on with them by --resume, "
                "or give another --out"
            )
        for name, value in self.header.items():
            if entries[0].get(name) != value:
                began = OTHER.get(name) or f"{name} {entries[0].get(name)}, not {value}"
                raise StateError(
                    f"{self.path}: was begun with {began}: runs of both would be mixed; give "
                    "another --out"
                )
        for entry in entries[1:]:
            row = _row(self.path, entry)
            self.rows[key(row.setting, row.seed)] = row
        return whole


def whole_lines(path: Path) -> Iterator[tuple[dict[str, Any], int]]:
    """The entries of a journal, each with where its line ends. Raises StateError for lines that are
    none.
    """
    try:
        content = path.read_bytes()
    except OSError as cause:
        raise StateError(f"{path}: cannot be read ({cause.strerror})") from cause
    end = 0
    for number, line in enumerate(content.splitlines(keepends=True), 1):
        end += len(line)
        if not line.endswith(b"\n"):
            return
        try:
            entry = json.loads(line)
        except ValueError:
            entry = None
        if not isinstance(entry, dict):
            raise StateError(
                f"{path}: line {number} is no entry of a journal; take it out, or give another "
                "--out"
            )
        yield entry, end


def _row(path: Path, entry: Mapping[str, Any]) -> Row:
    """The row of an entry. Raises StateError where it is none."""
    kinds = {
        "setting": dict,
        "seed": int,
        "record": dict | None,
        "error": str | None,
        "took_s": float | int,
    }
    for name, kind in kinds.items():
        if name not in entry or not isinstance(entry[name], kind):
            raise StateError(f"{path}: a row without {name!r} as it should be; give another --out")
    return Row(*(entry[name] for name in kinds))
