"""`mcloc simulate --beacons N --ceiling --landmarks N`, and the runs that it says to go on with."""

import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from tests.cli.conftest import Mcloc

SHORT = ("--length", 5, "--seed", 3, "--format", "carmen")
QUIET = ("--seed", 1, "--threads", 1, "--no-plot")
ALL = ("--beacons", 6, "--ceiling", "--landmarks", 30)
BEACONS, CEILING = ("--beacons", "--beacon-ranges"), ("--ceiling", "--images")


@pytest.fixture(scope="module")
def made(mcloc: Mcloc, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with all there is, and done.json: what was told."""
    out = tmp_path_factory.mktemp("made")
    done = mcloc("simulate", *SHORT, *ALL, "--json", "--out", out)
    assert done.code == 0, done.stderr
    (out / "done.json").write_text(done.stdout)
    return out


def command(made: Path, name: str, without: tuple[str, ...] = ()) -> list[str]:
    """Arguments of the run that is said to go on with, but for some options and their values."""
    words = shlex.split(json.loads((made / "done.json").read_text())[name])
    assert words[:2] == ["mcloc", "run"]
    for option in without:
        at = words.index(option)
        del words[at : at + 2]
    return words[1:]


@pytest.mark.parametrize(
    ("without", "worst"),
    [
        # A bias of 0.2 m for each beacon, of which six together leave less.
        (CEILING, 0.3),
        (BEACONS, 0.2),
        ((), 0.3),
    ],
    ids=["beacons", "images", "both"],
)
def test_the_robot_is_tracked_without_a_laser(
    without: tuple[str, ...], worst: float, made: Path, mcloc: Mcloc, tmp_path: Path
) -> None:
    words = command(made, "next_without_laser", without)
    assert "--no-scans" in words
    done = mcloc(*words, *QUIET, "--out", tmp_path)
    assert done.code == 0, done.stderr
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["accuracy"]["position_median_m"] < worst
    assert "stamp" not in done.stdout  # nothing was late or out of order


def test_the_robot_is_found_with_the_laser(made: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    words = command(made, "next")
    assert "--no-scans" not in words
    assert set(words) >= {*BEACONS, *CEILING}
    done = mcloc(*words, *QUIET, "--out", tmp_path)
    assert done.code == 0, done.stderr


def test_the_robot_is_tracked_by_landmarks(made: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    """Whose ranges are some 0.1 m off."""
    done = mcloc(*command(made, "next_by_landmarks"), *QUIET, "--out", tmp_path)
    assert done.code == 0, done.stderr
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["accuracy"]["position_median_sighted_m"] < 0.2
    assert "ignored" not in done.stdout


def test_the_drive_is_the_same_with_and_without(made: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    done = mcloc("simulate", *SHORT, "--out", tmp_path)
    assert done.code == 0, done.stderr
    assert "no laser" not in done.stdout
    for name in ("map.yaml", "map.pgm", "log.gz", "truth.csv"):
        assert (tmp_path / name).read_bytes() == (made / name).read_bytes()


def test_one_seed_the_same_bytes_another_seed_others(
    made: Path, mcloc: Mcloc, tmp_path: Path
) -> None:
    files = [file for file in made.rglob("*") if file.is_file() and file.name != "done.json"]
    for out, seed in (("a", 3), ("b", 4)):
        options = (*SHORT, "--seed", seed, *ALL)
        done = mcloc("simulate", *options, "--out", tmp_path / out)
        assert done.code == 0, done.stderr
    for file in files:
        name = file.relative_to(made)
        assert (tmp_path / "a" / name).read_bytes() == file.read_bytes(), name
    differing = "beacons.csv", "ranges.csv", "ceiling.png", "images/000000.png"
    for name in (*differing, "mrclam/Robot1_Measurement.dat"):
        assert (tmp_path / "b" / name).read_bytes() != (made / name).read_bytes(), name


def test_ranges_and_images_are_of_the_drive(made: Path) -> None:
    t, _, r, *antenna = np.genfromtxt(made / "ranges.csv", delimiter=",", skip_header=1).T
    beacons = np.loadtxt(made / "beacons.csv", delimiter=",", skiprows=1)
    truth = np.loadtxt(made / "truth.csv", delimiter=",", skiprows=1)
    assert len(beacons) == 6
    assert set(np.round(np.diff(np.unique(t)), 6)) == {0.4}
    assert t[-1] == pytest.approx(truth[-1, 0], abs=0.5)
    x, y = (np.interp(t, truth[:, 0], truth[:, k]) for k in (1, 2))
    bx, by, bz = np.tile(beacons[:, 1:], (len(np.unique(t)), 1)).T
    d = np.hypot(np.hypot(bx - x, by - y), bz - antenna[2])
    # 0.1 m of antenna; biases of 0.2 m.
    assert np.nanmedian(np.abs(r - d)) < 0.4
    index = (made / "images/index.csv").read_text().splitlines()
    assert index[0] == "t,file"
    assert len(index) - 1 == len(list((made / "images").glob("*.png")))
    assert float(index[-1].split(",")[0]) == pytest.approx(truth[-1, 0], abs=0.5)


@pytest.mark.parametrize("n", [0, -1, 1001])
@pytest.mark.parametrize("what", ["--beacons", "--landmarks"])
def test_a_wrong_number_is_one_line(what: str, n: int, mcloc: Mcloc, tmp_path: Path) -> None:
    done = mcloc("simulate", *SHORT, what, n, "--out", tmp_path / "out")
    assert done.code == 2
    assert done.stdout == ""
    assert done.stderr == f"error: {what} = {n} must be >= 1 and <= 1000\n"
    assert not (tmp_path / "out").exists()


def test_what_is_in_the_way_is_named(mcloc: Mcloc, tmp_path: Path) -> None:
    (tmp_path / "beacons.csv").mkdir()
    done = mcloc("simulate", *SHORT, "--beacons", 3, "--out", tmp_path)
    assert done.code == 2
    assert "beacons.csv: cannot be written to" in done.stderr
