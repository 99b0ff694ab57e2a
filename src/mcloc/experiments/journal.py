"""An append-only journal of a study, in JSON lines: a run that is in it is never made again.

The first line says which study it is of, each further one is a row. A line that was cut off by a
crash is no row; it is overwritten.
"""

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any

from mcloc.errors import StateError
from mcloc.experiments.table import Row, Setting

NAME = "journal.jsonl"


def key(setting: Setting, seed: int) -> str:
    """What tells one run of a study from another."""
    return json.dumps([sorted(setting.items()), seed])


class Journal:
    """The rows of a study in a file of a folder.

    header: what must be the same for rows to be of one study. resume: go on with what is there.
    Raises StateError where there is a journal and it is not to be resumed, or is of another study.
    """

    def __init__(self, folder: Path, header: Mapping[str, Any], resume: bool) -> None:
        self.path = folder / NAME
        self.header = dict(header)
        self.rows: dict[str, Row] = {}
        whole = 0
        if self.path.exists():
            whole = self._read(resume)
        self._file: IO[str] = self.path.open("a", encoding="utf-8")
        self._file.truncate(whole)
        if whole == 0:
            self._write(self.header)

    def __enter__(self) -> "Journal":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def add(self, row: Row) -> None:
        """Take note of a row; it is on the disk when this returns."""
        if key(row.setting, row.seed) in self.rows:
            return
        self.rows[key(row.setting, row.seed)] = row
        self._write(
            {
                "setting": dict(row.setting),
                "seed": row.seed,
                "record": row.record,
                "error": row.error,
                "took_s": row.took,
            }
        )

    def _write(self, entry: Mapping[str, Any]) -> None:
        self._file.write(json.dumps(entry, ensure_ascii=False, allow_nan=False) + "\n")
        self._file.flush()
        os.fsync(self._file.fileno())

    def _read(self, resume: bool) -> int:
        """Take the rows in; how many bytes of the file are whole lines."""
        entries, whole = [], 0
        for entry, end in whole_lines(self.path):
            entries.append(entry)
            whole = end
        if not entries:
            return 0
        if not resume:
            raise StateError(
                f"{self.path}: holds {len(entries) - 1} runs already; go on with them by --resume, "
                "or give another --out"
            )
        for name, value in self.header.items():
            if entries[0].get(name) != value:
                raise StateError(
                    f"{self.path}: was begun with {name} = {entries[0].get(name)!r}, now it is "
                    f"{value!r}: runs of both would be mixed; give another --out"
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
    try:
        return Row(
            entry["setting"], entry["seed"], entry["record"], entry["error"], entry["took_s"]
        )
    except KeyError as cause:
        raise StateError(f"{path}: a row without {cause}; give another --out") from cause
