"""Maps on a topic."""

import sqlite3

import numpy as np
import pytest

from mcloc.errors import ConfigError, LogError, MapError
from mcloc.io.bag_map import read_map

CELLS = np.array([[0, 100, -1], [50, 0, 7]], dtype=np.int8)


@pytest.fixture
def grid(ros):
    def grid(cells=CELLS, at=(0.0, 0.0), q=(0, 0, 0, 1), resolution=0.05, **info):
        height, width = cells.shape
        values = {
            "map_load_time": ros.stamp(1.0),
            "resolution": resolution,
            "width": width,
            "height": height,
            "origin": ros.pose(*at, q),
        }
        fields = {"header": ros.header(1.0, "map"), "info": values | info, "data": cells.ravel()}
        return "/map", "nav_msgs/msg/OccupancyGrid", fields

    return grid


def test_every_kind_of_bag_gives_the_same_map(write, ros, grid, kind):
    path = write([grid(at=(-1.5, 2.5), q=ros.yaw(0.3))], kind)
    found = read_map(path, "map")
    np.testing.assert_array_equal(found.cells, CELLS)
    assert found.resolution == 0.05  # not 0.05000000074505806
    assert found.origin == pytest.approx([-1.5, 2.5, 0.3])
    assert found.name == f"{path}, /map"
    assert found.occupied[0, 1]
    assert found.unknown[0, 2]


def test_a_cell_lies_where_ros_says(write, ros, grid):
    """Cell (row 1, column 2) of a map that is turned by 90°: its centre, by hand."""
    cells = np.zeros((2, 3), dtype=np.int8)
    cells[1, 2] = 100
    found = read_map(write([grid(cells, (10.0, 20.0), ros.yaw(np.pi / 2), 1.0)]), "/map")
    assert found.state_at((10.0 - 1.5, 20.0 + 2.5, 0.0)) == "occupied"
    assert found.state_at((10.0 - 1.5, 20.0 + 1.5, 0.0)) == "free"


def test_the_last_map_with_free_cells_counts(write, grid):
    none = np.zeros((0, 0), dtype=np.int8)
    first = np.array([[0, -1]], dtype=np.int8)
    walls = np.full((2, 3), 100, dtype=np.int8)
    found = read_map(write([grid(none), grid(first), grid(), grid(walls), grid(none)]), "/map")
    np.testing.assert_array_equal(found.cells, CELLS)
    with pytest.raises(MapError, match="no message holds a map with free cells"):
        read_map(write([grid(walls), grid(np.full((2, 3), 50, dtype=np.int8))], name="b"), "/map")


def test_of_a_damaged_bag_the_last_map_before_the_damage_counts(write, grid):
    maps = [np.full((300, 300), k, dtype=np.int8) for k in range(6)]
    path = write([grid(cells) for cells in maps], "sqlite messages")
    (file,) = path.glob("*.db3")
    with sqlite3.connect(file) as bag:
        bag.execute("UPDATE messages SET data = x'00' WHERE id = 4")
    bag.close()
    np.testing.assert_array_equal(read_map(path, "/map").cells, maps[2])
    with sqlite3.connect(file) as bag:
        bag.execute("UPDATE messages SET data = x'00'")
    bag.close()
    with pytest.raises(LogError, match="cannot be read"):
        read_map(path, "/map")


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"q": (np.sin(0.1), 0, 0, np.cos(0.1))}, "tilted"),
        ({"q": (1, 0, 0, 0)}, "tilted"),
        ({"q": (0, 0, 0, 0)}, "origin must be"),
        ({"at": (np.nan, 0.0)}, "origin must be"),
        ({"resolution": 0.0}, "resolution must be"),
        ({"resolution": np.nan}, "resolution must be"),
        ({"width": 4}, "4 × 2 cells stated, 6 given"),
        ({"cells": np.array([[-5, 101]], dtype=np.int8)}, "got -5 … 101"),
        ({"cells": np.zeros((0, 3), dtype=np.int8)}, "no message holds a map"),
    ],
)
def test_a_map_that_cannot_be_right(write, grid, options, reason):
    with pytest.raises(MapError, match=rf"drive, /map: .*{reason}"):
        read_map(write([grid(**options)]), "/map")


def test_what_holds_no_map(write, ros, grid, tmp_path):
    path = write([grid(), ros.scan(1.0)])
    with pytest.raises(ConfigError, match="no topic '/floor'"):
        read_map(path, "/floor")
    with pytest.raises(ConfigError, match="/scan is sensor_msgs/LaserScan, not nav_msgs/Occ"):
        read_map(path, "/scan")
    (tmp_path / "map.yaml").write_text("image: map.pgm\n")
    with pytest.raises(LogError, match=r"map\.yaml: not a ROS bag"):
        read_map(tmp_path / "map.yaml", "/map")
