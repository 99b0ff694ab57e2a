"""Which map a file holds; what is none; saving."""

import gzip

import numpy as np
import pytest

from mcloc.errors import MapError
from mcloc.maps.files import load, save
from mcloc.maps.occupancy import OccupancyGrid

WEAN = b"robot_specifications->resolution 10\nglobal_map[0]: 1 2\n1.0 0.0\n"
TRINARY = np.array([[0, 100, -1], [100, -1, 0]])
GRADED = np.arange(-1, 101).reshape(2, 51)


@pytest.mark.parametrize("name", ["wean.dat", "wean.dat.gz", "any.yaml"])
@pytest.mark.parametrize("pack", [bytes, gzip.compress])
def test_a_wean_map_is_told_by_its_content(tmp_path, name, pack):
    (tmp_path / name).write_bytes(pack(WEAN))
    assert OccupancyGrid.load(tmp_path / name).cells.tolist() == [[0], [100]]


@pytest.mark.parametrize(
    ("cells", "thresholds", "mode"),
    [
        (TRINARY, (0.65, 0.196), "trinary"),
        (TRINARY, (0.65, 0.25), "raw"),  # here 205, the usual shade of unknown, would be free
        (TRINARY, (1.0, 0.0), "raw"),
        (GRADED, (0.65, 0.196), "raw"),
        (np.array([[-1]]), (0.9, 0.1), "trinary"),
    ],
)
def test_a_saved_map_comes_back_as_it_was(tmp_path, cells, thresholds, mode):
    grid = OccupancyGrid(cells, 1 / 30, (-1.5e-7, 2.25, 0.3), *thresholds)
    path = tmp_path / "a: map #1.yaml"
    grid.save(path)
    again = OccupancyGrid.load(path)
    assert again.cells.tolist() == cells.tolist()
    assert again.occupied.tolist() == grid.occupied.tolist()
    assert again.free.tolist() == grid.free.tolist()
    assert again.resolution == grid.resolution
    assert again.origin.tolist() == grid.origin.tolist()
    assert (again.occupied_thresh, again.free_thresh) == thresholds
    assert f"mode: {mode}" in path.read_text()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a: map #1.pgm", "a: map #1.yaml"]


def test_a_saved_image_is_the_one_that_ros_writes(tmp_path):
    save(OccupancyGrid(TRINARY, 0.05, (0, 0, 0)), tmp_path / "map.yaml")
    assert (tmp_path / "map.pgm").read_bytes() == b"P5\n3 2\n255\n" + bytes(
        [0, 205, 254, 254, 0, 205]
    )


@pytest.mark.parametrize(
    ("name", "reason"), [("map.png", "must end in"), ("no/map.yaml", "No such")]
)
def test_where_nothing_can_be_written(tmp_path, name, reason):
    with pytest.raises(MapError, match=reason):
        save(OccupancyGrid(TRINARY, 0.05, (0, 0, 0)), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_failed_save_leaves_the_map_that_was_there(tmp_path):
    old = OccupancyGrid(TRINARY, 0.05, (0, 0, 0))
    old.save(tmp_path / "map.yaml")
    (tmp_path / "map.yaml.part").mkdir()
    with pytest.raises(MapError, match="cannot be written"):
        OccupancyGrid(GRADED, 0.1, (0, 0, 0)).save(tmp_path / "map.yaml")
    assert load(tmp_path / "map.yaml").cells.tolist() == TRINARY.tolist()


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("map.yaml", b"", "empty"),
        ("map.pgm", b"P5\n1 1\n255\n\x00", "give a ROS map's .yaml"),
        ("drive.log", b"FLASER 0\n", "not a map"),
        ("wean.dat.gz", gzip.compress(WEAN, mtime=0)[:-9], "cut or damaged"),
    ],
)
def test_what_is_no_map(tmp_path, name, content, reason):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MapError, match=f"{name}.*{reason}"):
        load(tmp_path / name)


def test_what_is_no_file(tmp_path):
    for path in (tmp_path, tmp_path / "missing.yaml"):
        with pytest.raises(MapError, match=str(path)):
            load(path)
