"""`mcloc run --ceiling … --images …`: by the camera alone, and what is refused."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from tests.cli.conftest import Mcloc

from mcloc.config import RunConfig, read_entries
from mcloc.report import Run
from mcloc.report.checkpoint import Checkpoints, resume
from mcloc.simulation import CeilingTour, ceiling_drive, museum_world, write_ceiling_drive


@pytest.fixture(scope="module")
def museum(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("museum")
    tour = CeilingTour(duration=40.0, images=3.0)
    write_ceiling_drive(ceiling_drive(museum_world(1), 1, tour), folder)
    return folder


@pytest.fixture(scope="module")
def options(museum: Path) -> list[str]:
    _, x, y, theta = np.loadtxt(museum / "truth.csv", delimiter=",", skiprows=1)[0]
    return [
        *("--map", str(museum / "map.yaml"), "--log", str(museum / "log.gz"), "--seed", "3"),
        *("--ceiling", str(museum / "ceiling.yaml"), "--images", str(museum / "images")),
        *("--truth", str(museum / "truth.csv"), "--no-scans", "--threads", "1"),
        *("--initial", f"{x},{y},{np.degrees(theta)}"),
    ]


@pytest.mark.parametrize(("camera", "worst"), [("ceiling-patch", 0.2), ("ceiling-brightness", 1)])
def test_the_camera_alone_tracks_a_robot(
    options: list[str], mcloc: Mcloc, tmp_path: Path, camera: str, worst: float
) -> None:
    out = mcloc("run", *options, "--camera", camera, "--out", tmp_path)
    assert out.code == 0, out.stderr
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["accuracy"]["position_median_m"] < worst
    again = mcloc("run", "--config", tmp_path / "config.yaml", "--out", tmp_path / "again")
    assert again.code == 0, again.stderr
    same = (tmp_path / "again" / "estimates.csv").read_bytes()
    assert same == (tmp_path / "estimates.csv").read_bytes()


def test_a_run_is_resumed_with_its_ceiling(
    options: list[str], mcloc: Mcloc, tmp_path: Path
) -> None:
    out = mcloc("run", *options, "--out", tmp_path)
    assert out.code == 0, out.stderr
    config = RunConfig(**read_entries(tmp_path / "config.yaml"))
    whole, cut = Run(config), Run(config)
    for _ in whole.by_event():
        pass
    for _ in itertools.islice(cut.by_event(), 200):
        pass
    Checkpoints(tmp_path / "c.npz", 60.0).save(cut)
    rest = resume(tmp_path / "c.npz")
    for _ in rest.by_event():
        pass
    assert 0 < cut.consumed < whole.consumed
    assert rest.history.rows.table.tobytes() == whole.history.rows.table.tobytes()


@pytest.mark.parametrize(
    ("left_out", "match"),
    [("--images", "a ceiling camera needs both"), ("--ceiling", "a ceiling camera needs both")],
)
def test_half_a_camera_is_refused(
    options: list[str], mcloc: Mcloc, tmp_path: Path, left_out: str, match: str
) -> None:
    at = options.index(left_out)
    out = mcloc("run", *options[:at], *options[at + 2 :], "--out", tmp_path)
    assert out.code == 2
    assert match in out.stderr


def test_a_wrong_pixel_is_told_with_the_remedy(
    options: list[str], mcloc: Mcloc, tmp_path: Path
) -> None:
    out = mcloc("run", *options, "--set", "camera.pixel=0.01", "--out", tmp_path)
    assert out.code == 2
    assert "pixel = 0.01 m" in out.stderr
    assert "set it to what a pixel covers" in out.stderr


def test_the_camera_is_among_the_models(mcloc: Mcloc) -> None:
    out = mcloc("models")
    assert out.code == 0, out.stderr
    assert "ceiling-patch" in out.stdout
    assert "ceiling-brightness" in out.stdout
