"""Logs of CMU's Wean Hall."""

import numpy as np
import pytest

from mcloc.errors import LogError
from mcloc.events import Odometry, Scan
from mcloc.io.log import read_log

POSE = "100 -200 1.5707963267948966"
LASER = "100 -175 1.5707963267948966"


def sweep(ranges=("250",) * 180, pose=POSE, laser=LASER, t="2.5"):
    return " ".join(["L", pose, laser, *ranges, t])


@pytest.fixture
def read(tmp_path):
    def read(*lines):
        path = tmp_path / "robotdata.log"
        path.write_text("\n".join(lines) + "\n")
        log = read_log(path)
        return list(log), log.skipped

    return read


def test_lines_are_odometry_and_scans_in_metres(read):
    odometry, scan = read(f"O {POSE} 1.25", sweep())[0]
    assert isinstance(odometry, Odometry)
    assert odometry.t == 1.25
    assert odometry.pose == pytest.approx([1.0, -2.0, np.pi / 2])
    assert isinstance(scan, Scan)
    assert scan.t == 2.5
    assert scan.ranges == pytest.approx(np.full(180, 2.5))
    assert scan.odometry == pytest.approx([1.0, -2.0, np.pi / 2])
    assert scan.mount == pytest.approx([0.25, 0.0, 0.0])
    assert np.rad2deg(scan.angles[[0, 1, -1]]) == pytest.approx([-90.0, -89.0, 89.0])


def test_no_return_is_beyond_the_range(read):
    (scan,), _ = read(sweep(["100"] * 178 + ["8183", "8191"]))
    assert (scan.ranges[-2:] >= scan.range_max).all()
    assert scan.ranges[-1] == pytest.approx(81.91)


@pytest.mark.parametrize("line", [sweep(), f"O {POSE} 1.0"], ids=["L", "O"])
def test_a_cut_line_raises_after_what_came_before_it(tmp_path, line):
    path = tmp_path / "cut.log"
    words = line.split()
    for kept in {1, 2, 4, 7, 8, 9, 100, len(words) - 1} & set(range(1, len(words))):
        path.write_text(sweep() + "\n" + " ".join(words[:kept]))
        events = iter(read_log(path))
        next(events)
        with pytest.raises(LogError, match=rf"cut\.log, line 2: {words[0]}: .*cut"):
            next(events)
