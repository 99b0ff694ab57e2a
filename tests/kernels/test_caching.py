"""Where what is compiled is kept, and until when: processes of their own, on copies of mcloc."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

import mcloc

NOBODY = 65534
PROGRAM = """
import numpy as np
import mcloc
from mcloc.kernels.compiling import announced
from mcloc.kernels.weights import log_sums

with announced(lambda: print("compiling")):
    _, (total,) = log_sums(np.array([0.0, -1.0]), np.zeros(2), 0.0)
print(mcloc.__file__, round(float(np.exp(total)), 3))
"""

pytestmark = pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")


def copied(folder: Path) -> Path:
    """A copy of mcloc that nothing has been compiled for."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(mcloc.__file__).parent, folder / "mcloc", ignore=ignored)
    return folder


def run(program: str, package: Path, **more) -> str:
    """What it prints, with mcloc from a folder."""
    env = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    path = os.pathsep.join(filter(None, [str(package), env.get("PYTHONPATH")]))
    return subprocess.run(
        [sys.executable, "-c", program],
        env={**env, "PYTHONPATH": path, **more.pop("env", {})},
        cwd=package,
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
        **more,
    ).stdout


def test_what_is_compiled_is_kept_until_a_file_of_kernels_changes(tmp_path: Path) -> None:
    """Any file of them: what is part of a kernel may be written down in another."""
    package = copied(tmp_path)
    printed = f"{package / 'mcloc' / '__init__.py'} 1.368\n"
    assert run(PROGRAM, package) == f"compiling\n{printed}"
    assert list((package / "mcloc" / "kernels" / "__pycache__").glob("weights.summed*.nbc"))
    assert run(PROGRAM, package) == printed
    elementary = package / "mcloc" / "kernels" / "elementary.py"
    text = elementary.read_text()
    assert text.count("return 0.0 if x < _LEAST else p * power") == 1
    elementary.write_text(text.replace("else p * power", "else 2.0 * p * power"))
    assert run(PROGRAM, package) == f"compiling\n{printed.replace('1.368', '2.736')}"


def can_run_as_nobody() -> bool:
    """Whether there is another user to become, who can read the interpreter and its libraries."""
    if os.name != "posix" or os.geteuid() != 0:
        return False
    command = [sys.executable, "-c", "import numba, scipy"]
    try:
        tried = subprocess.run(command, cwd="/", user=NOBODY, group=NOBODY, extra_groups=[])
    except PermissionError:
        return False
    return tried.returncode == 0


def test_a_user_who_may_not_write_there_has_a_cache_of_his_own() -> None:
    """mcloc in a folder that is read-only, as where an administrator has installed it."""
    if not can_run_as_nobody():
        pytest.skip("there is no other user who can read the interpreter")
    with tempfile.TemporaryDirectory() as folder:  # pytest's own folders are closed to others
        os.chmod(folder, 0o755)
        package, home = copied(Path(folder) / "installed"), Path(folder) / "home"
        home.mkdir()
        os.chown(home, NOBODY, NOBODY)
        for path in [package, *package.rglob("*")]:
            path.chmod(0o555 if path.is_dir() else 0o444)
        as_nobody = {
            "user": NOBODY,
            "group": NOBODY,
            "extra_groups": [],
            "env": {"HOME": str(home), "XDG_CACHE_HOME": str(home / "cache")},
        }
        printed = f"{package / 'mcloc' / '__init__.py'} 1.368\n"
        assert run(PROGRAM, package, **as_nobody) == f"compiling\n{printed}"
        assert list((home / "cache").rglob("weights.summed*.nbc"))
        assert not list(package.rglob("*.nbc"))
        assert run(PROGRAM, package, **as_nobody) == printed
