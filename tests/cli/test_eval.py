"""`mcloc eval`: a bag gives it the odometry, which is all that it needs of one."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcloc.events import Odometry, Scan
from mcloc.io.bag_writer import BagWriter

Mcloc = Callable[..., Any]
STAMPS = np.arange(1.0, 11.0, 0.1)  # s
JUMP = 5.05  # s


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """10 s along x at 0.5 m/s, and after JUMP 20 m to the side."""
    table = np.column_stack([STAMPS, 0.5 * STAMPS, 20.0 * (STAMPS > JUMP), 0.0 * STAMPS])
    path = tmp_path_factory.mktemp("truth") / "truth.csv"
    np.savetxt(path, table, delimiter=",", header="t,x,y,theta", comments="")
    return path


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Wheels that know nothing of the jump, a copy of the truth called odometry, and two lasers in
    frames that lead nowhere.
    """
    folder = tmp_path_factory.mktemp("bag") / "drive"
    beams = np.array([1.0, 2.0]), np.array([0.0, 0.1])
    with BagWriter(folder) as writer:
        for t in STAMPS:
            at = 0.5 * t, 20.0 * (t > JUMP), 0.0
            writer.odometry("/gt_odom", Odometry(t, np.array(at)), child="elsewhere")
            writer.odometry("/odom", Odometry(t, np.array([at[0], 0.0, 0.0])), child="elsewhere")
            writer.scan(Scan(t, *beams, 8.0, source="front"))
            writer.scan(Scan(t, *beams, 8.0, source="rear"))
    return folder


def test_the_odometry_of_a_bag_shows_kidnappings(mcloc: Mcloc, truth: Path, bag: Path) -> None:
    def recoveries(*more: object) -> list[dict[str, float]]:
        done = mcloc("eval", truth, truth, *more, "--json")
        assert done.code == 0, done.stderr
        found: list[dict[str, float]] = json.loads(done.stdout)["recoveries"]
        return found

    assert recoveries() == []
    (recovery,) = recoveries("--log", bag, "--topic", "odometry=/odom")
    assert recovery["t"] == pytest.approx(JUMP, abs=0.1)
    assert recoveries("--log", bag, "--topic", "odometry=/gt_odom") == []


def test_which_odometry_is_meant_can_be_said(mcloc: Mcloc, truth: Path, bag: Path) -> None:
    done = mcloc("eval", truth, truth, "--log", bag)
    assert done.code == 2
    assert "/odom, /gt_odom; choose with --topic odometry=/odom" in done.stderr


def test_a_topic_is_of_a_log(mcloc: Mcloc, truth: Path) -> None:
    done = mcloc("eval", truth, truth, "--topic", "odometry=/odom")
    assert done.code == 2
    assert "--log" in done.stderr
