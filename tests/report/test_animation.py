"""Snapshots of a belief stay few, and become a film that tells what happened."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from mcloc.config import RunConfig
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.particles import Particles
from mcloc.report import Run
from mcloc.report.animation import DOTS, FRAMES, Snapshots, animate
from mcloc.simulation import Scenario, office_world, simulate, write_drive

KIDNAPPED = 8.0  # s


def cloud(n: int) -> Particles:
    """Particle k stands at x = k."""
    return Particles.equal(np.stack([np.arange(n), np.zeros(n), np.zeros(n)]).astype(float))


def estimate(t: float, updated: bool = True, particles: Particles | None = None) -> Any:
    update = SimpleNamespace(particles=particles or cloud(3))
    return SimpleNamespace(t=t, pose=np.zeros(3), updated=updated, update=update)


@pytest.mark.parametrize("updates", [1, FRAMES, FRAMES + 1, 777, 5000])
def test_snapshots_are_few_and_spread_over_the_whole_run(updates: int) -> None:
    snapshots = Snapshots()
    for t in range(updates):
        snapshots.add(estimate(float(t)))
    t = np.array([snapshot.t for snapshot in snapshots.kept])
    assert t[0] == 0.0
    assert min(updates, FRAMES // 2) <= len(t) <= FRAMES
    steps = np.unique(np.diff(t))
    assert len(steps) <= 1
    assert updates - t[-1] <= (steps[0] if len(steps) else 1.0)


def test_only_updates_are_noted() -> None:
    snapshots = Snapshots()
    for t in range(10):
        snapshots.add(estimate(float(t), updated=t % 3 == 0))
    assert [snapshot.t for snapshot in snapshots.kept] == [0.0, 3.0, 6.0, 9.0]


def test_dots_stand_for_equal_parts_of_the_belief() -> None:
    n = 4000
    heavy = np.log(np.where(np.arange(n) == 7, 1.0 * n, 1.0))  # half of all weight
    particles = Particles.normalized(cloud(n).states, heavy)
    snapshots = Snapshots()
    snapshots.add(estimate(0.0, particles=particles))
    (snapshot,) = snapshots.kept
    assert snapshot.n == n
    assert snapshot.dots.shape == (2, DOTS)
    x = snapshot.dots[0]
    assert (x == 7).sum() == pytest.approx(DOTS / 2, abs=1)
    assert np.median(x[x != 7]) == pytest.approx(n / 2, rel=0.02)


def test_few_particles_are_all_shown() -> None:
    snapshots = Snapshots()
    snapshots.add(estimate(0.0, particles=cloud(20)))
    np.testing.assert_array_equal(snapshots.kept[0].dots[0], np.arange(20))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drive")
    scenario = Scenario(length=8.0, kidnap_at=(KIDNAPPED,))
    write_drive(simulate(office_world(1), 1, scenario), folder, "carmen")
    return folder


def filmed(folder: Path, path: Path, map_name: str = "map.yaml", truth: bool = True) -> Snapshots:
    """Make a run over the drive, and its GIF."""
    known = f"{folder}/truth.csv" if truth else None
    config = RunConfig(f"{folder}/{map_name}", f"{folder}/log.gz", truth=known, seed=1)
    run, snapshots = Run(config), Snapshots()
    for e in run:
        snapshots.add(e)
    animate(run, snapshots, path)
    return snapshots


def near(frame: Image.Image, colour: tuple[int, int, int]) -> int:
    """How many pixels look like a colour."""
    off = np.asarray(frame.convert("RGB")).astype(int) - colour
    return int((np.abs(off).max(axis=-1) < 25).sum())


def test_a_film_of_each_snapshot_with_the_kidnapping_from_its_moment_on(
    folder: Path, tmp_path: Path
) -> None:
    snapshots = filmed(folder, tmp_path / "run.gif")
    assert (tmp_path / "run.gif").stat().st_size < 3e6
    red = []
    with Image.open(tmp_path / "run.gif") as film:
        assert film.n_frames == len(snapshots.kept)  # type: ignore[attr-defined]
        for k in range(len(snapshots.kept)):
            film.seek(k)
            red.append(near(film, (192, 57, 43)))
    after = np.array([snapshot.t for snapshot in snapshots.kept]) >= KIDNAPPED
    assert 0 < after.sum() < len(after)
    assert min(np.array(red)[after]) > max(np.array(red)[~after])


def test_the_film_is_the_same_each_time_and_without_a_truth_too(
    folder: Path, tmp_path: Path
) -> None:
    for name in "ab":
        filmed(folder, tmp_path / name, truth=False)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_map_that_is_turned_is_shown_as_it_lies(folder: Path, tmp_path: Path) -> None:
    flat = OccupancyGrid.load(folder / "map.yaml")
    turned = OccupancyGrid(flat.cells, flat.resolution, np.array([1.0, 2.0, np.pi / 2]))
    turned.save(folder / "turned.yaml")
    sizes = []
    for name in ("map.yaml", "turned.yaml"):
        filmed(folder, tmp_path / f"{name}.gif", name, truth=False)
        with Image.open(tmp_path / f"{name}.gif") as film:
            sizes.append(film.size)
    assert sizes[0][0] > sizes[0][1]
    assert sizes[1][0] < sizes[1][1]
