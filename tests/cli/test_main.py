"""The program as a whole: help, version, models, and what it costs to start."""

import errno
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import mcloc as package
from mcloc.report.checkpoint import NAME as CHECKPOINT
from mcloc.report.checkpoint import VERSION
from mcloc.simulation import office_drive, write_drive
from mcloc.storage import read_state

Mcloc = Callable[..., Any]


def test_help_imports_nothing_heavy() -> None:
    program = (
        "import sys\n"
        "from mcloc.cli.main import app\n"
        "app(['--help'], standalone_mode=False)\n"
        "heavy = {'numpy', 'scipy', 'numba', 'matplotlib', 'rosbags', 'PIL', 'yaml'}\n"
        "print('heavy:', sorted(heavy & set(sys.modules)))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60
    )
    assert "Usage" in done.stdout
    assert done.stdout.endswith("heavy: []\n")


def test_version(mcloc: Mcloc) -> None:
    assert mcloc("--version").stdout == f"mcloc {package.__version__}\n"


@pytest.mark.parametrize("command", ["run", "eval", "info", "simulate", "models", "team"])
def test_each_command_has_help(command: str, mcloc: Mcloc) -> None:
    done = mcloc(command, "--help")
    assert done.code == 0
    assert "Usage" in done.stdout


def test_models_lists_every_parameter(mcloc: Mcloc) -> None:
    from mcloc.config import CHOICES
    from mcloc.registry import parameters
    from mcloc.report.joined import OF_MEMBER

    listed = json.loads(mcloc("models", "--json").stdout)
    assert set(listed) == {*CHOICES, "update", "detection", "team", "peers"}
    for kind, part in OF_MEMBER.items():
        for field in parameters(part):
            entry = listed[kind][kind]["parameters"][field.name]
            assert entry["default"] == field.default
            assert entry["doc"]
            assert entry["limits"]
    shown = mcloc("models").stdout
    for kind, registry in CHOICES.items():
        assert set(listed[kind]) == set(registry)
        assert sum(model["default"] for model in listed[kind].values()) == 1
        for name in registry:
            for field in parameters(registry.get(name)):
                entry = listed[kind][name]["parameters"][field.name]
                assert entry["default"] == field.default
                assert entry["unit"] == field.metadata["unit"]
                assert f"{kind}.{field.name}" in shown


PROGRAM = [sys.executable, "-c", "from mcloc.cli.main import main; main()"]


def test_terminated_it_writes_what_it_has(tmp_path: Path) -> None:
    write_drive(office_drive(seed=1, length=40.0), tmp_path)
    out = tmp_path / "out"
    process = subprocess.Popen(
        [
            *(*PROGRAM, "run", "--map", str(tmp_path / "map.yaml"), "--no-plot"),
            *("--log", str(tmp_path / "log.gz"), "--size", "fixed", "--particles", "50000"),
            *("--checkpoint-every", "0s", "--threads", "1", "--out", str(out)),
        ],
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        while process.poll() is None and not updates(out / CHECKPOINT):
            time.sleep(0.02)
        process.terminate()
        _, said = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 143, said
    assert said.splitlines()[-1] == "interrupted"
    assert f"are in {out}" in said
    scans = len((out / "estimates.csv").read_text(encoding="utf-8").splitlines()) - 1
    assert scans == json.loads((out / "summary.json").read_text(encoding="utf-8"))["scans"] > 0
    assert (out / "config.yaml").exists()


def updates(checkpoint: Path) -> int:
    """How many updates a run had made when it was saved."""
    if not checkpoint.exists():
        return 0
    _, arrays = read_state(checkpoint, VERSION)
    return len(arrays["history.updates"])


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no full device")
@pytest.mark.parametrize("arguments", [["models"], ["models", "--json"], ["--help"]])
def test_output_that_cannot_be_written_is_an_error(arguments: list[str]) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*PROGRAM, *arguments], stdout=full, stderr=subprocess.PIPE, text=True, timeout=60
        )
    assert done.returncode == 1
    assert done.stderr == f"error: stdout cannot be written ({os.strerror(errno.ENOSPC)})\n"


def test_a_reader_that_has_gone_is_none() -> None:
    """As with `mcloc models | head -1`."""
    there, here = os.pipe()
    os.close(there)
    done = subprocess.run(
        [*PROGRAM, "models"], stdout=here, stderr=subprocess.PIPE, text=True, timeout=60
    )
    os.close(here)
    assert done.returncode == 1
    assert done.stderr == ""


@pytest.mark.parametrize("encoding", ["latin-1", "cp1252", "ascii"])
def test_letters_that_an_output_lacks_are_replaced(encoding: str) -> None:
    program = (
        f"from mcloc.cli import main; main.app = lambda: print('{chr(0x3B8)} 1.0'); main.main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONIOENCODING": encoding},
        capture_output=True,
        timeout=60,
    )
    assert done.stdout == b"? 1.0\n", done.stderr


def test_every_public_name_is_there() -> None:
    for name in package.__all__:
        assert getattr(package, name) is not None
    assert set(package.__all__) <= set(dir(package))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        package.nothing  # noqa: B018
