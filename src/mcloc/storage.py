"""Files that appear whole or not at all, and states in them: JSON for values, npz for arrays."""

import json
import os
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError, StateError

Arrays = dict[str, NDArray[Any]]

_DAMAGE = (
    *(ValueError, KeyError, TypeError, AttributeError, EOFError, RuntimeError, MemoryError),
    *(OverflowError, SyntaxError, zipfile.BadZipFile, zlib.error, struct.error),
)
"""What NumPy, zipfile and json raise over bytes that are not what they should be."""

VALUES = "values.json"  # the entry of the npz that holds the text


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Somewhere to write what then takes the place of `path`. Raises ConfigError where that
    fails.
    """
    unfinished = path.with_name(f".{path.name}.unfinished")
    try:
        yield unfinished
        os.replace(unfinished, path)
    except OSError as cause:
        raise ConfigError(f"{path}: cannot be written ({cause.strerror})") from cause
    finally:
        unfinished.unlink(missing_ok=True)


def write_state(path: str | Path, values: Mapping[str, Any], arrays: Arrays) -> None:
    """Write values (what JSON knows) and arrays into one .npz file, on the disk when this returns.

    Raises ConfigError where the file cannot be written.
    """
    text = np.frombuffer(json.dumps(values).encode(), dtype=np.uint8)
    with replacing(Path(path)) as unfinished, unfinished.open("wb") as file:
        np.savez(file, allow_pickle=False, **{VALUES: text}, **arrays)
        file.flush()
        os.fsync(file.fileno())


def read_state(path: str | Path, version: int) -> tuple[dict[str, Any], Arrays]:
    """The values and arrays of a file from `write_state`. No code in it is ever executed.

    Raises StateError for a file that is missing, damaged, no state, or one whose value "version" is
    another.
    """
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as entries:
            arrays = {name: entries[name] for name in entries.files}
        values = json.loads(arrays.pop(VALUES).tobytes())
        found = values["version"]
    except OSError as cause:
        raise StateError(f"{path}: cannot be read ({cause.strerror or cause})") from cause
    except _DAMAGE as cause:
        raise StateError(f"{path}: damaged, or no saved state of mcloc") from cause
    if found != version:
        raise StateError(
            f"{path}: a state of version {found}, but this mcloc reads version {version}; "
            "start without it"
        )
    return values, arrays
