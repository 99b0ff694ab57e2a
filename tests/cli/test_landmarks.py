"""A robot that sees landmarks, as an MRCLAM folder: localized from anywhere, told about, drawn,
gone on with, and asked for in wrong ways.
"""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcloc.config import RunConfig
from mcloc.geometry import wrap
from mcloc.io.tum import read_trajectory
from mcloc.report import Run, accuracy_of, write_run
from mcloc.report.checkpoint import NAME, Checkpoints, resume
from mcloc.report.history import SILENT

Mcloc = Callable[..., Any]

PLACES = {6: (-2.5, 2.0), 7: (3.0, 2.5), 8: (0.0, -3.0), 9: (3.0, -2.0), 10: (-3.0, -1.5)}
CODES = {1: 5, 2: 14, 6: 63, 7: 81, 8: 7, 9: 70, 10: 45}
SPEED, TURN, LENGTH = 0.3, 0.2, 60.0  # m/s, rad/s, s: around a circle of 1.5 m
BLIND = 25.0, 37.0  # s, when nothing is seen
GAP = 45.0, 47.0  # s, when nobody knows the truth


def truth(t: np.ndarray) -> np.ndarray:
    """(N, 3): the true poses."""
    theta = 0.4 + TURN * t
    r = SPEED / TURN
    return np.stack([r * np.sin(theta), -r * np.cos(theta), wrap(theta)], axis=-1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Wheels that turn 3 % too far, ranges 4 % off, bearings 0.02 rad, stamps of a clock of its
    own; another robot is seen, too.
    """
    rng, where = np.random.default_rng(4), tmp_path_factory.mktemp("seen")
    start = 1_000_000.0
    (where / "Barcodes.dat").write_text("".join(f"{s} {c}\n" for s, c in CODES.items()))
    (where / "Landmark_Groundtruth.dat").write_text(
        "# subject x y sd_x sd_y\n"
        + "".join(f"{s}\t{x}\t{y}\t0.001\t0.001\n" for s, (x, y) in PLACES.items())
    )
    stamps = np.arange(0.0, LENGTH, 0.05)
    (where / "Robot3_Odometry.dat").write_text(
        "".join(f"{start + t:.3f} {SPEED} {1.03 * TURN}\n" for t in stamps)
    )
    seen = []
    for t in np.arange(1.0, LENGTH - 1.0, 0.25):
        if BLIND[0] < t < BLIND[1]:
            continue
        (pose,) = truth(np.array([t]))
        for subject, (x, y) in PLACES.items():
            d, b = np.hypot(x - pose[0], y - pose[1]), np.arctan2(y - pose[1], x - pose[0])
            r, b = d * rng.normal(1.0, 0.04), wrap(b - pose[2]) + rng.normal(0.0, 0.02)
            if abs(b) < 0.8:
                seen.append(f"{start + t:.3f} {CODES[subject]} {r:.3f} {b:.3f}\n")
        if rng.random() < 0.1:
            seen.append(f"{start + t:.3f} {CODES[1]} 1.0 0.0\n")
    (where / "Robot3_Measurement.dat").write_text("".join(seen))
    known = np.arange(-2.0, LENGTH - 5.0, 0.02)
    known = known[(known < GAP[0]) | (known > GAP[1])]
    (where / "Robot3_Groundtruth.dat").write_text(
        "".join(
            f"{start + t:.3f} {x:.5f} {y:.5f} {theta:.5f}\n"
            for t, (x, y, theta) in zip(known, truth(known), strict=True)
        )
    )
    return where


@pytest.fixture(scope="module")
def config(folder: Path) -> RunConfig:
    return RunConfig(None, str(folder), robot=3, seed=1)


def made(config: RunConfig) -> Run:
    run = Run(config)
    for _ in run:
        pass
    return run


@pytest.fixture(scope="module")
def run(config: RunConfig) -> Run:
    return made(config)


def test_it_is_found_anywhere_by_landmarks_alone(run: Run) -> None:
    accuracy = accuracy_of(run)
    assert accuracy is not None
    assert accuracy.position_median_sighted_m is not None
    assert accuracy.position_median_sighted_m < 0.1
    assert accuracy.converged
    assert accuracy.time_to_converge_s is not None
    assert accuracy.time_to_converge_s < 15.0
    assert run.grid.name.endswith("Landmark_Groundtruth.dat")
    low = np.min(list(PLACES.values()), axis=0) - 8.0
    assert run.grid.origin[:2] == pytest.approx(low)


def test_the_wheels_carry_it_while_nothing_is_seen(run: Run) -> None:
    """From the last sighting before the blind time on; their turns are 3 % off, so that 12 s later
    it is some 0.1 m off, while a straight line between the sightings would be metres off.
    """
    history = run.history
    t, carried = history.column("t") - 1_000_000.0, history.column("carried") == 1.0
    blind = carried & (t > BLIND[0]) & (t < BLIND[1])
    assert np.diff(t[blind]).max() < SILENT + 0.06
    assert t[blind][-1] > BLIND[1] - 2.0 * SILENT
    off = history.trajectory.poses[blind, :2] - truth(t[blind])[:, :2]
    assert np.hypot(*off.T).max() < 0.5
    wheels = history.wheels
    assert wheels.t.tolist() == history.column("t").tolist()
    moved = np.hypot(*np.diff(wheels.poses[:, :2], axis=0).T).sum()
    assert moved == pytest.approx(SPEED * (t[-1] - t[0]), rel=0.01)
    # Of those, the filter has followed the wheels each 0.5 m, or 0.5 rad.
    assert (~carried).sum() == len(history.sighted) == history.scans
    steps = history.updates.table[:, 0] - 1_000_000.0
    steps = steps[(steps > BLIND[0]) & (steps < BLIND[1])]
    assert np.diff(steps) == pytest.approx(0.5 / SPEED, abs=0.06)


def test_nothing_is_carried_while_the_filter_withholds_its_estimate(run: Run) -> None:
    history, n = run.history, len(run.history)
    last = history.rows.last
    blind = last[0] + 1.0
    history.withhold(last[0] + 0.5, np.array(last[-3:]))
    share = history.share_withheld
    history.carry(run.localizer, blind)
    assert len(history) == n
    history.withheld.drop_last()
    history.carry(run.localizer, blind)
    assert len(history) == n + 1
    history.rows.drop_last()
    assert share == pytest.approx(1.0 / (1 + (history.column("carried") == 0.0).sum()))


def test_errors_are_told_where_the_truth_is_known_and_landmarks_were_seen(run: Run) -> None:
    """`sighted` counts references within 5 s of a sighting, none of them in the gap."""
    accuracy = accuracy_of(run)
    assert accuracy is not None
    assert run.truth is not None
    t = run.truth.t - 1_000_000.0
    covered = t[(t >= 1.0) & (t <= run.history.column("t")[-1] - 1_000_000.0)]
    assert not ((covered > GAP[0] + 0.01) & (covered < GAP[1] - 0.01)).any()
    seen = run.history.sighted.table[:, 0] - 1_000_000.0
    near = np.abs(covered[:, None] - seen).min(axis=1) <= 5.0
    assert abs(accuracy.sighted - near.sum()) <= 2
    assert 0.0 < near.mean() < 1.0


def test_the_command_tells_it(run: Run, folder: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    out = tmp_path / "out"
    asked = "run", "--log", folder, "--robot", 3, "--seed", 1, "--out", out
    done = mcloc(*asked, "--gif", "--record")
    assert done.code == 0, done.stderr
    assert "within 5 s of a landmark" in done.stdout
    summary = json.loads((out / "summary.json").read_text())
    assert summary["accuracy"]["position_median_sighted_m"] < 0.1
    assert summary["accuracy"]["sighted"] > 1000
    assert summary["scans"] == run.history.scans < summary["updates"]
    assert summary["ignored"]["sighting of another robot"] > 5
    assert (out / "run.png").stat().st_size > 20_000
    assert len(read_trajectory(out / "trajectory.tum")) > summary["scans"]
    repeated = mcloc("run", "--config", out / "config.yaml", "--out", tmp_path / "again")
    assert repeated.code == 0, repeated.stderr
    for name in ("estimates.csv", "trajectory.tum"):
        assert (tmp_path / "again" / name).read_bytes() == (out / name).read_bytes()


def test_it_is_gone_on_with_after_any_event(config: RunConfig, run: Run, tmp_path: Path) -> None:
    write_run(run, tmp_path, plot=False)
    expected = (tmp_path / "estimates.csv").read_bytes()
    for stop in (30, 640):
        saves, broken = Checkpoints(tmp_path / NAME, every=0.0), Run(config)
        for _ in zip(range(stop), broken.by_event(), strict=False):
            pass
        saves.save(broken)
        again = resume(tmp_path / NAME)
        for _ in again:
            pass
        other = tmp_path / f"from{stop}"
        other.mkdir()
        summary = write_run(again, other, plot=False)
        assert (other / "estimates.csv").read_bytes() == expected
        accuracy = accuracy_of(run)
        assert accuracy is not None
        assert summary["accuracy"]["sighted"] == accuracy.sighted


def test_a_kalman_filter_tracks_it_from_the_start(folder: Path) -> None:
    (start,) = truth(np.array([1.0]))
    tracked = made(
        RunConfig(
            None, str(folder), robot=3, seed=1, filter="kalman", initial=tuple(start.tolist())
        )
    )
    accuracy = accuracy_of(tracked)
    assert accuracy is not None
    assert accuracy.position_median_sighted_m is not None
    assert accuracy.position_median_sighted_m < 0.1


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((), "which robot? Its robots are 3; give one with --robot"),
        (("--robot", 1), "there is no robot 1: Its robots are 3"),
        (("--robot", 3, "--topic", "scan=/scan"), "topics are of ROS bags"),
        (("--robot", 3, "--filter", "kalman"), "--initial"),
        (("--robot", 3, "--derive-sonar", 16), "--derive-sonar is about the scans"),
        (("--robot", 3, "--no-scans"), "--no-scans is about the scans of a log, and an MRCLAM"),
    ],
)
def test_what_cannot_be_is_refused(
    folder: Path, mcloc: Mcloc, tmp_path: Path, given: tuple[object, ...], message: str
) -> None:
    done = mcloc("run", "--log", folder, *given, "--out", tmp_path)
    assert done.code == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) <= 2


def test_a_robot_is_of_a_folder(drive: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    log = "--log", drive / "log.gz", "--robot", 3, "--out", tmp_path
    done = mcloc("run", "--map", drive / "map.yaml", *log)
    assert done.code == 2
    assert "leave --robot out" in done.stderr
    done = mcloc("run", *log)
    assert done.code == 2
    assert "which map?" in done.stderr


def test_other_commands_know_the_folder(folder: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    told = mcloc("info", folder, "--robot", 3)
    assert told.code == 0, told.stderr
    assert "sighting of another robot" in told.stdout
    assert re.search(r"driven +18(\.0)? m", told.stdout)  # 0.3 m/s for 59.95 s
    unnamed = mcloc("info", folder)
    assert unnamed.code == 2
    assert "Its robots are 3" in unnamed.stderr
    log = "--log", folder, "--robot", 3
    out = tmp_path / "out"
    assert mcloc("run", *log, "--seed", 1, "--no-plot", "--out", out).code == 0
    compared = mcloc("eval", out, out / "trajectory.tum", *log)
    assert compared.code == 0, compared.stderr
    assert "max 0.000 m" in compared.stdout
    assert mcloc("eval", out, out / "trajectory.tum", "--robot", 3).code == 2


def test_what_is_in_the_folder_is_told(folder: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    """Against its files; robot 1, who never saw anything, is not asked about."""
    rows = np.loadtxt(folder / "Robot3_Measurement.dat")
    counts = {str(s): int((rows[:, 1] == CODES[s]).sum()) for s in PLACES}
    done = mcloc("info", folder, "--robot", 3, "--json")
    assert done.code == 0, done.stderr
    log = json.loads(done.stdout)["log"]
    seen, truth = log["sightings"], log["truth"]
    assert seen["of_landmark"] == counts
    assert seen["sightings"] == sum(counts.values())
    landmarks = np.unique(rows[rows[:, 1] != CODES[1], 0])
    assert seen["events"] == len(landmarks)
    assert seen["longest_gap_s"] == pytest.approx(np.diff(landmarks).max(), abs=1e-6)
    middle = np.median(rows[rows[:, 1] != CODES[1], 2])
    assert seen["range_median_m"] == pytest.approx(middle, rel=0.05)
    assert log["skipped"] == {"sighting of another robot": int((rows[:, 1] == CODES[1]).sum())}
    known = np.loadtxt(folder / "Robot3_Groundtruth.dat")[:, 0] - 1_000_000.0
    assert truth["events"] == len(known)
    assert truth["longest_gap_s"] == pytest.approx(GAP[1] - GAP[0], abs=0.03)
    assert truth["share"] == pytest.approx(known[-1] / (LENGTH - 0.05), abs=1e-3)
    story = mcloc("info", folder, "--robot", 3).stdout
    assert "5 known, 5 of them seen" in story
    assert f"of each: 6: {counts['6']}, 7: {counts['7']}" in story
    assert re.search(r"truth +\d+ poses, .* gaps up to 2\.02 s, during 91\.7 % of the log", story)


def test_a_folder_is_told_up_to_what_is_damaged(folder: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    cut = tmp_path / "cut"
    shutil.copytree(folder, cut)
    (cut / "Robot3_Groundtruth.dat").write_text("1.0 2.0\n")
    done = mcloc("info", cut, "--robot", 3)
    assert done.code == 2
    assert "5 known" in done.stdout
    assert "  truth" not in done.stdout
    assert "line 1: 4 numbers expected" in done.stderr


def test_walls_are_not_compared_with_landmarks(folder: Path, drive: Path, mcloc: Mcloc) -> None:
    done = mcloc("info", drive / "map.yaml", folder, "--robot", 3)
    assert done.code == 0, done.stderr
    assert "not compared: the log has no scans" in done.stdout


def test_the_truth_of_a_folder_is_taken_for_a_comparison(
    folder: Path, mcloc: Mcloc, tmp_path: Path
) -> None:
    """What `mcloc eval` tells is what the run told, but for what depends on when it began."""
    out = tmp_path / "out"
    asked = "--log", folder, "--robot", 3, "--seed", 1, "--no-plot", "--out", out
    assert mcloc("run", *asked).code == 0
    of_run = json.loads((out / "summary.json").read_text())["accuracy"]
    done = mcloc("eval", out, folder, "--robot", 3, "--json")
    assert done.code == 0, done.stderr
    told = json.loads(done.stdout)
    assert told.keys() == of_run.keys()
    for key in ("position_median_m", "position_max_m", "position_median_sighted_m"):
        assert told[key] == pytest.approx(of_run[key], abs=1e-3)
    # References at the edges of these 5 s, and those of the first and the last estimate.
    assert told["sighted"] == pytest.approx(of_run["sighted"], abs=4)
    assert told["recoveries"] == []
    assert "5 s of a landmark seen" in mcloc("eval", out, folder, "--robot", 3).stdout
    unnamed = mcloc("eval", out, folder)
    assert unnamed.code == 2
    assert "which robot? Its robots are 3" in unnamed.stderr
    untold = tmp_path / "untold"
    shutil.copytree(folder, untold)
    (untold / "Robot3_Groundtruth.dat").unlink()
    done = mcloc("eval", out, untold, "--robot", 3)
    assert done.code == 2
    assert "has no truth about robot 3" in done.stderr


def test_walls_may_be_given_too(folder: Path, drive: Path) -> None:
    """A map takes the place of the open floor."""
    run = Run(RunConfig(f"{drive}/map.yaml", str(folder), robot=3, seed=1))
    assert run.grid.name.endswith("map.yaml")
    assert run.landmarks is not None
