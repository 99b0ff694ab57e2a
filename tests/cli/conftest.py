"""A short drive whose truth is known, and a way to call the program."""

from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mcloc.cli.main import app
from mcloc.simulation import office_drive, write_drive

Mcloc = Callable[..., "Outcome"]


class Outcome:
    """What a call printed and returned."""

    def __init__(self, code: int, stdout: str, stderr: str) -> None:
        self.code, self.stdout, self.stderr = code, stdout, stderr


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with map.yaml, log.gz and truth.csv of 15 m through an office."""
    folder = tmp_path_factory.mktemp("drive")
    write_drive(office_drive(seed=1, length=15.0), folder)
    return folder


@pytest.fixture(scope="session")
def mcloc() -> Mcloc:
    """Call `mcloc` with these arguments; nothing but its own errors may come out."""

    def call(*arguments: object) -> Outcome:
        result = CliRunner().invoke(app, [str(a) for a in arguments])
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return Outcome(result.exit_code, result.stdout, result.stderr)

    return call


@pytest.fixture(scope="session")
def start(drive: Path) -> str:
    """The true start of the drive, as --initial takes it."""
    import numpy as np

    _, x, y, theta = np.loadtxt(drive / "truth.csv", delimiter=",", skiprows=1)[0]
    return f"{x},{y},{np.degrees(theta)}"


@pytest.fixture(scope="session")
def tracked(
    drive: Path, start: str, mcloc: Mcloc, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """The folder of a run from the true start, with the truth."""
    out = tmp_path_factory.mktemp("tracked") / "out"
    done = mcloc(
        *("run", "--map", drive / "map.yaml", "--log", drive / "log.gz", "--seed", 7),
        *("--truth", drive / "truth.csv", "--initial", start, "--out", out),
    )
    assert done.code == 0, done.stderr
    return out
