"""A bag is read in pieces: three gigabytes of camera images take no memory."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "big_bag.py"
MOST = 500  # MB, of which about 200 are Python with what it imports


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells the peak of a process")
@pytest.mark.parametrize(("format", "gigabytes"), [("mcap", 3.0), ("ros1", 0.5)])
def test_memory_does_not_grow_with_the_bag(
    format: str, gigabytes: float, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    command = [sys.executable, str(BENCHMARK), "--gigabytes", str(gigabytes), "--format", format]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = re.search(r"peak (\d+) MB", done.stdout)
    assert found is not None
    assert 50 < int(found[1]) < MOST
