"""The notice of a compilation: before it, once, and never for what a cache holds."""

import subprocess
import sys
from pathlib import Path

PROGRAM = """
from numba import njit
from mcloc.kernels.compiling import announced

@njit(cache=True)
def first(x):
    return x + 1.0

@njit(cache=True)
def second(x):
    return x + 2.0

with announced(lambda: print("compiling", not first.signatures)):
    first(1.0)
    second(1.0)
    first(2.0)
"""


def test_says_so_once_and_only_where_nothing_is_cached(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    printed = [
        subprocess.run(
            [sys.executable, str(program)], capture_output=True, text=True, check=True, timeout=120
        ).stdout
        for _ in range(2)
    ]
    assert printed == ["compiling True\n", ""]
