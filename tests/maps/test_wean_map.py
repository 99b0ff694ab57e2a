"""CMU's wean.dat: lines are x, columns are y, 1 is free."""

import numpy as np
import pytest

from mcloc.errors import MapError
from mcloc.maps.files import load

HEADER = "robot_specifications->global_mapsize_x 8000\nrobot_specifications->resolution   10\n\n"


@pytest.fixture
def read(tmp_path):
    def read(content):
        path = tmp_path / "wean.dat"
        path.write_text(content)
        return load(path)

    return read


def test_lines_are_x_and_one_is_free(read):
    grid = read(HEADER + "global_map[0]: 2 3\n-1.000 1.000 0.000\n0.999 0.790 0.300\n")
    assert grid.cells.tolist() == [[-1, 0], [0, 21], [100, 70]]
    assert grid.resolution == pytest.approx(0.1)
    assert grid.origin.tolist() == [0.0, 0.0, 0.0]
    assert grid.state_at((0.05, 0.15, 0.0)) == "free"
    assert grid.state_at((0.05, 0.25, 0.0)) == "occupied"
    assert grid.state_at((0.15, 0.15, 0.0)) == "unknown"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("global_map[0]: 1 1\n1.0\n", "has no line robot_specifications->resolution"),
        ("robot_specifications->resolution 0\nglobal_map[0]: 1 1\n1\n", "resolution must be from"),
        ("robot_specifications->resolution x\nglobal_map[0]: 1 1\n1\n", "line 1: .*numbers"),
        (HEADER + "global_map[0]: 800\n", "line 4: .*numbers"),
        (HEADER + "global_map[0]: 0 5\n", "line 4: a map of 0 × 5"),
        (HEADER + "global_map[0]: 2 2\n1 1\n", "ends after 1 of 2"),
        (HEADER + "global_map[0]: 2 2\n1 1\n1\n", "line 6: 2 cells expected, 1 found"),
        (HEADER + "global_map[0]: 1 2\n1 1\n1 1\n", "line 6: more than the 1 lines"),
        (HEADER + "global_map[0]: 1 2\n1 wall\n", "line 5: .*'wall'"),
        (HEADER + "global_map[0]: 1 2\n1 1.5\n", "line 5: a cell must be"),
        (HEADER + "global_map[0]: 1 2\n1 nan\n", "line 5: a cell must be"),
        (HEADER + "global_map[0]: 99999999 99999999\n1 1\n", "99999999 cells expected"),
        (HEADER + "global_map[0]: 99999999 2\n1 1\n", "ends after 1 of 99999999"),
    ],
)
def test_what_cannot_be_used_is_named(read, content, reason):
    with pytest.raises(MapError, match=rf"wean\.dat.*{reason}"):
        read(content)


def test_cells_are_whole_percents(read):
    free = np.linspace(0.0, 1.0, 101)
    grid = read(HEADER + "global_map[0]: 1 101\n" + " ".join(f"{p:.3f}" for p in free))
    assert grid.cells[:, 0].tolist() == list(range(100, -1, -1))
