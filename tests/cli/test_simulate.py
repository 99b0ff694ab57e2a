"""`mcloc simulate`: what it writes, says and refuses."""

import json
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcloc.events import Scan
from mcloc.io.log import read_log
from mcloc.io.tum import read_trajectory
from mcloc.maps.occupancy import OCCUPIED, OccupancyGrid
from mcloc.simulation import office_world

Mcloc = Callable[..., Any]
SHORT = ("--length", 4, "--format", "carmen")


def scans_of(log: Path) -> list[Scan]:
    return [event for event in read_log(str(log)) if isinstance(event, Scan)]


def test_a_folder_to_go_on_with(mcloc: Mcloc, tmp_path: Path) -> None:
    done = mcloc("simulate", *SHORT, "--seed", 3, "--out", tmp_path / "my drive")
    assert done.code == 0, done.stderr
    command = shlex.split(done.stdout.splitlines()[-1].removeprefix("go on"))
    assert command[:2] == ["mcloc", "run"]
    again = mcloc(*command[1:], "--seed", 1, "--no-plot", "--out", tmp_path / "run")
    assert again.code == 0, again.stderr

    grid = OccupancyGrid.load(tmp_path / "my drive/map.yaml")
    np.testing.assert_array_equal(grid.occupied, office_world(3).occupied)
    truth = read_trajectory(tmp_path / "my drive/truth.csv")
    assert len(truth) == len(scans_of(tmp_path / "my drive/log.gz"))


def test_json_and_nothing_else(mcloc: Mcloc, tmp_path: Path) -> None:
    done = mcloc("simulate", *SHORT, "--kidnap", 1, "--json", "--out", tmp_path)
    written = json.loads(done.stdout)
    assert written["scans"] == len(scans_of(Path(written["log"])))
    (kidnapped,) = written["kidnappings_s"]
    assert 4.0 <= kidnapped < 4.05  # half of 4 m at 0.5 m/s
    assert written["distance_m"] == pytest.approx(4.0, abs=1.0)


def test_two_lasers_in_a_bag(mcloc: Mcloc, tmp_path: Path) -> None:
    done = mcloc("simulate", "--length", 3, "--lasers", 2, "--people", 2, "--out", tmp_path)
    assert done.code == 0, done.stderr
    assert (tmp_path / "log" / "metadata.yaml").exists()
    assert {scan.source.strip("/") for scan in scans_of(tmp_path / "log")} == {"front", "rear"}


def test_options_change_what_is_recorded(mcloc: Mcloc, tmp_path: Path) -> None:
    shares = {}
    for name, options in {"few": (), "many": ("--missing", 0.5)}.items():
        assert mcloc("simulate", *SHORT, *options, "--out", tmp_path / name).code == 0
        scans = scans_of(tmp_path / name / "log.gz")
        shares[name] = np.mean([scan.returned for scan in scans])
    assert shares["many"] == pytest.approx(shares["few"] * 0.5 / 0.98, abs=0.03)


def test_any_map_will_do_and_stays_as_it_is(mcloc: Mcloc, tmp_path: Path) -> None:
    office_world(8).save(tmp_path / "floor.yaml")
    given = ("--map", tmp_path / "floor.yaml", "--seed", 1)
    assert mcloc("simulate", *SHORT, *given, "--out", tmp_path / "a").code == 0
    assert OccupancyGrid.load(tmp_path / "a/map.yaml").state_at([10.0, 7.0, 0.0]) == "free"

    given = ("--map", tmp_path / "a/map.yaml")
    before = (tmp_path / "a/map.pgm").read_bytes()
    refused = mcloc("simulate", *SHORT, *given, "--out", tmp_path / "a", "--unmapped-glass")
    assert refused.code == 2
    assert "would be replaced" in refused.stderr
    assert (tmp_path / "a/map.pgm").read_bytes() == before


@pytest.mark.parametrize("name", ["floor.yaml", "there/../floor.yaml", "link.yaml"])
def test_the_image_of_a_map_is_not_replaced(name: str, mcloc: Mcloc, tmp_path: Path) -> None:
    """Nor where a map of another name has it, or the map is linked to."""
    folder = tmp_path / "maps"
    (folder / "there").mkdir(parents=True)
    office_world(8).save(folder / "map.yaml")
    (folder / "map.yaml").rename(folder / "floor.yaml")
    (folder / "link.yaml").symlink_to(folder / "floor.yaml")
    before = (folder / "map.pgm").read_bytes()
    done = mcloc("simulate", *SHORT, "--map", folder / name, "--out", folder / "there" / "..")
    assert done.code == 2
    assert "would be replaced; give another folder" in done.stderr
    assert (folder / "map.pgm").read_bytes() == before


def test_a_map_without_room(mcloc: Mcloc, tmp_path: Path) -> None:
    solid = np.full((40, 40), OCCUPIED, dtype=np.int8)
    OccupancyGrid(solid, 0.05, np.zeros(3)).save(tmp_path / "solid.yaml")
    done = mcloc("simulate", "--map", tmp_path / "solid.yaml", "--out", tmp_path / "out")
    assert done.code == 2
    assert "solid.yaml" in done.stderr
    assert "no robot can drive here" in done.stderr


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (("--length", 0), "error: --length = 0.0 m must be >= 1"),
        (("--length", "nan"), "length"),
        (("--world", "ofice"), "office"),
        (("--world", "office", "--map", "x.yaml"), "exclude"),
        (("--kidnap", 1, "--kidnap-at", 3), "exclude"),
        (("--kidnap-at", 9999), "9999"),
        (("--kidnap-at", -1), "kidnappings"),
        (("--lasers", 3), "--lasers"),
        (("--format", "bag"), "mcap"),
        (("--glass", 2), "glass"),
        (("--slip", -0.1), "error: --slip = -0.1 must be"),
        (("--missing", 1.1), "missing"),
        (("--people", -1), "people"),
        (("--range-max", 0), "error: --range-max = 0.0 m must be > 0"),
        (("--seed", -1), "seed"),
        (("--map", "nowhere.yaml"), "nowhere.yaml"),
    ],
)
def test_wrong_input_is_named(
    options: tuple[object, ...], named: str, mcloc: Mcloc, tmp_path: Path
) -> None:
    done = mcloc("simulate", "--length", 4, *options, "--out", tmp_path / "out")
    assert done.code == 2
    assert done.stdout == ""
    assert done.stderr.startswith("error: ")
    assert named in done.stderr


def test_a_folder_that_cannot_be(mcloc: Mcloc, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    done = mcloc("simulate", *SHORT, "--out", tmp_path / "file")
    assert done.code == 2
    assert "file" in done.stderr
