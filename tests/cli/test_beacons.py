"""`mcloc run --beacons … --beacon-ranges …`, with and without the laser, and resumed."""

import json
from pathlib import Path

import numpy as np
import pytest
from tests.cli.conftest import Mcloc

from mcloc.config import RunConfig, read_entries
from mcloc.events import Scan
from mcloc.io.log import read_log
from mcloc.io.tum import read_trajectory
from mcloc.report import Run
from mcloc.report.checkpoint import Checkpoints, resume

HEIGHT = 2.0  # m above the antenna


@pytest.fixture(scope="module")
def files(drive: Path, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Options for four beacons around a drive, the last of which is always 3 m short."""
    folder = tmp_path_factory.mktemp("beacons")
    truth = read_trajectory(drive / "truth.csv")
    low, high = truth.poses[:, :2].min(axis=0) - 2.0, truth.poses[:, :2].max(axis=0) + 2.0
    places = [low, high, (low[0], high[1]), (high[0], low[1])]
    rows = [f"{name},{x},{y},{HEIGHT}" for name, (x, y) in zip("abcd", places, strict=True)]
    (folder / "beacons.csv").write_text("\n".join(["beacon_id,x,y,z", *rows]) + "\n")
    rng, lines = np.random.default_rng(1), ["scan_index,beacon_id,range_m"]
    scans = [event.t for event in read_log(drive / "log.gz") if isinstance(event, Scan)]
    for k, (x, y, _) in enumerate(truth.at(np.array(scans))):
        for name, place in zip("abcd", places, strict=True):
            d = np.hypot(np.hypot(*(place - np.array([x, y]))), HEIGHT)
            r = d + rng.normal(0.0, 0.1) - (3.0 if name == "d" else 0.0)
            lines.append(f"{k},{name},{r:.3f}")
    (folder / "ranges.csv").write_text("\n".join([*lines, f"{len(scans) + 1},a,1", "0,x,1"]))
    return [
        *("--map", str(drive / "map.yaml"), "--log", str(drive / "log.gz"), "--seed", "3"),
        *("--truth", str(drive / "truth.csv"), "--threads", "1"),
        *("--beacons", str(folder / "beacons.csv")),
        *("--beacon-ranges", str(folder / "ranges.csv")),
    ]


def test_beacons_alone_find_the_robot(files: list[str], mcloc: Mcloc, tmp_path: Path) -> None:
    out = mcloc("run", *files, "--no-scans", "--out", tmp_path)
    assert out.code == 0, out.stderr
    assert "ignored    1 × range to unknown beacon x" in out.stdout
    assert "ignored    1 × range at a scan that the log has not" in out.stdout
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["accuracy"]["position_median_m"] < 0.3
    assert summary["beacons"]["d"]["explained"] < 0.3
    assert summary["beacons"]["d"]["trust"] < 0.5
    assert min(summary["beacons"][name]["trust"] for name in "abc") > 0.9
    assert f"beacon     d: {100 * summary['beacons']['d']['explained']:.0f} %" in out.stdout
    assert (tmp_path / "run.png").stat().st_size > 10_000
    again = mcloc("run", "--config", tmp_path / "config.yaml", "--out", tmp_path / "again")
    assert again.code == 0, again.stderr
    same = (tmp_path / "again" / "estimates.csv").read_bytes()
    assert same == (tmp_path / "estimates.csv").read_bytes()


def test_a_run_is_resumed_with_its_beacons(files: list[str], mcloc: Mcloc, tmp_path: Path) -> None:
    whole = mcloc("run", *files, "--no-plot", "--out", tmp_path / "whole")
    assert whole.code == 0, whole.stderr
    run = Run(RunConfig(**read_entries(tmp_path / "whole" / "config.yaml")))
    for k, _ in enumerate(run.by_event()):
        if k == 200:
            break
    Checkpoints(tmp_path / "c.npz", 60.0).save(run)
    rest = resume(tmp_path / "c.npz")
    assert rest.localizer.record == run.localizer.record != {}
    for _ in rest:
        pass
    lines = "".join(f"{line}\n" for line in rest.history.estimates_csv())
    assert lines == (tmp_path / "whole" / "estimates.csv").read_text()


def test_one_file_without_the_other_is_refused(
    files: list[str], mcloc: Mcloc, tmp_path: Path
) -> None:
    for left_out in ("--beacons", "--beacon-ranges"):
        k = files.index(left_out)
        out = mcloc("run", *files[:k], *files[k + 2 :], "--out", tmp_path)
        assert out.code == 2
        assert "beacons need both files" in out.stderr


def test_a_file_that_a_run_reads_is_not_replaced(
    files: list[str], mcloc: Mcloc, tmp_path: Path
) -> None:
    k = files.index("--beacon-ranges") + 1
    (tmp_path / "timing.csv").write_text(Path(files[k]).read_text())
    swapped = [*files[:k], str(tmp_path / "timing.csv"), *files[k + 1 :]]
    out = mcloc("run", *swapped, "--out", tmp_path)
    assert out.code == 2
    assert "would be replaced" in out.stderr


def test_nothing_to_localize_with(files: list[str], mcloc: Mcloc, tmp_path: Path) -> None:
    k = files.index("--beacons")
    out = mcloc("run", *files[:k], "--no-scans", "--out", tmp_path)
    assert out.code == 2
    assert "no scan" in out.stderr
