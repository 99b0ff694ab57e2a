"""`mcloc team run`: robots of a folder that see each other, and what is refused."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcloc.geometry import wrap
from mcloc.io.tum import read_trajectory
from mcloc.report.team import TeamConfig
from mcloc.report.team_picture import draw_team
from mcloc.report.team_run import TeamRun
from mcloc.team.team import Team

Mcloc = Callable[..., Any]

PLACES = {6: (-2.5, 2.0), 7: (3.0, 2.5), 8: (0.0, -3.0), 9: (3.0, -2.0), 10: (-3.0, -1.5)}
CODES = {1: 5, 2: 14, 3: 41, 6: 63, 7: 81, 8: 7, 9: 70, 10: 45}
SPEED, TURN, LENGTH = 0.3, 0.2, 40.0  # m/s, rad/s, s: around circles of 1.5 m
MIDDLE = {1: (-1.0, 0.0), 2: (1.0, 0.5), 3: (0.0, -1.0)}
START = 1_000_000.0  # s
QUICK = "--filter", "mcl", "--size", "fixed", "--set", "size.particles=300"

WITHOUT_NUMBERS = {
    "position_median_m",
    "position_rmse_m",
    "position_p95_m",
    "position_max_m",
    "heading_median_deg",
    "lost_fraction",
    "converged",
    "time_to_converge_s",
    "distance_to_converge_m",
    "time_to_find_s",
    "distance_to_find_m",
    "localized_fraction",
    "nees_median",
    "recoveries",
}


def truth(robot: int, t: np.ndarray) -> np.ndarray:
    """(N, 3): the true poses."""
    theta, r = 2.1 * robot + TURN * t, SPEED / TURN
    x, y = MIDDLE[robot]
    return np.stack([x + r * np.sin(theta), y - r * np.cos(theta), wrap(theta)], axis=-1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three robots with wheels that turn 3 % too far, ranges 4 % off, bearings 0.02 rad."""
    rng, where = np.random.default_rng(4), tmp_path_factory.mktemp("team")
    (where / "Barcodes.dat").write_text("".join(f"{s} {c}\n" for s, c in CODES.items()))
    (where / "Landmark_Groundtruth.dat").write_text(
        "".join(f"{s} {x} {y} 0 0\n" for s, (x, y) in PLACES.items())
    )
    for robot in MIDDLE:
        stamps = np.arange(0.0, LENGTH, 0.05)
        (where / f"Robot{robot}_Odometry.dat").write_text(
            "".join(f"{START + t:.3f} {SPEED} {1.03 * TURN}\n" for t in stamps)
        )
        seen = []
        for t in np.arange(1.0, LENGTH - 1.0, 0.25):
            (pose,) = truth(robot, np.array([t]))
            others = {k: truth(k, np.array([t]))[0, :2] for k in MIDDLE if k != robot}
            for subject, (x, y) in {**PLACES, **others}.items():
                d, b = np.hypot(x - pose[0], y - pose[1]), np.arctan2(y - pose[1], x - pose[0])
                r, b = d * rng.normal(1.0, 0.04), wrap(b - pose[2]) + rng.normal(0.0, 0.02)
                if abs(b) < 0.8:
                    seen.append(f"{START + t:.3f} {CODES[subject]} {r:.3f} {b:.3f}\n")
        (where / f"Robot{robot}_Measurement.dat").write_text("".join(seen))
        known = np.arange(-2.0, LENGTH, 0.02)
        (where / f"Robot{robot}_Groundtruth.dat").write_text(
            "".join(
                f"{START + t:.3f} {x:.5f} {y:.5f} {theta:.5f}\n"
                for t, (x, y, theta) in zip(known, truth(robot, known), strict=True)
            )
        )
    return where


@pytest.fixture(scope="module")
def told(folder: Path, mcloc: Mcloc, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run in which robot 1 alone uses landmarks."""
    out = tmp_path_factory.mktemp("told") / "out"
    options = "--landmarks-for", "1", "--seed", "3", "--json", "--out", out
    done = mcloc("team", "run", "--data", folder, *options)
    assert done.code == 0
    assert json.loads(done.stdout) == json.loads((out / "summary.json").read_text())
    return out


def test_json_has_what_was_promised_and_nothing_else(told: Path) -> None:
    summary = json.loads((told / "summary.json").read_text())
    assert set(summary) == {"seed", "robots", "detections", "message_bytes"}
    assert summary["seed"] == 3
    assert set(summary["robots"]) == {"1", "2", "3"}
    assert set(summary["robots"]["2"]) == WITHOUT_NUMBERS
    assert set(summary["robots"]["1"]) == WITHOUT_NUMBERS | {
        "sighted",
        "position_median_sighted_m",
    }
    assert set(summary["detections"]) == {"used", "ignored"}
    assert summary["detections"]["used"] > 5
    assert summary["detections"]["ignored"]["detection of the same robots again"] > 10
    assert set(summary["message_bytes"]) == {"median", "max"}
    assert 50 < summary["message_bytes"]["median"] <= summary["message_bytes"]["max"] < 4000


def test_robots_without_landmarks_are_found_by_the_one_that_has_them(told: Path) -> None:
    robots = json.loads((told / "summary.json").read_text())["robots"]
    assert robots["1"]["position_median_m"] < 0.1
    for name in "23":
        assert robots[name]["position_median_m"] < 0.5
        path = read_trajectory(told / f"robot{name}.tum")
        true = truth(int(name), path.t - START)
        off = np.hypot(*(path.poses - true)[:, :2].T)
        assert np.median(off[path.t > START + 20.0]) < 0.4
        assert (told / f"robot{name}.csv").read_text().startswith("t,x,y,theta,cov_xx")


def test_a_picture_shows_each_robot(folder: Path, told: Path, tmp_path: Path) -> None:
    assert (told / "team.png").read_bytes().startswith(b"\x89PNG")
    run = TeamRun(TeamConfig(str(folder), (1,), seed=3))
    for _ in run:
        pass
    draw_team(run, tmp_path / "again.png")
    assert (tmp_path / "again.png").read_bytes() == (told / "team.png").read_bytes()
    # Robot 2 has a place from the first moment on at which it is told one.
    told_at = run.members["2"].told
    assert told_at == sorted(told_at)
    assert run.members["2"].history.column("t")[0] == told_at[0]
    assert sum(len(of.told) for of in run.members.values()) == len(run.message_bytes)


def test_an_interrupted_run_leaves_the_results_so_far(
    folder: Path, mcloc: Mcloc, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    process, calls = Team.process, []

    def interrupted(self: Team, robot: str, event: Any) -> Any:
        calls.append(event)
        if len(calls) == 1000:
            raise KeyboardInterrupt
        return process(self, robot, event)

    monkeypatch.setattr(Team, "process", interrupted)
    options = "--landmarks-for", "1", "--seed", "3", "--out", tmp_path
    done = mcloc("team", "run", "--data", folder, *options)
    assert done.code == 130
    assert f"results so far are in {tmp_path}" in done.stderr
    names = {path.name for path in tmp_path.iterdir()}
    assert {"summary.json", "team.png", "robot1.csv", "robot1.tum"} <= names
    path = read_trajectory(tmp_path / "robot1.tum")
    assert START < path.t[-1] < START + LENGTH / 2.0


def test_results_of_an_earlier_run_do_not_stay(folder: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    fewer, out = tmp_path / "fewer", tmp_path / "out"
    shutil.copytree(folder, fewer, ignore=shutil.ignore_patterns("Robot3_*"))
    out.mkdir()
    for name in ("robot10.tum", "robots.csv", "robot3.csv.old"):
        (out / name).write_text("before")
    options = "--seed", 1, *QUICK, "--out", out
    for data, robots, more in ((folder, "123", ["team.png"]), (fewer, "12", [])):
        plot = [] if more else ["--no-plot"]
        assert mcloc("team", "run", "--data", data, *options, *plot).code == 0
        files = {f"robot{n}.{kind}" for n in robots for kind in ("csv", "tum")}
        kept = {"robots.csv", "robot3.csv.old", "summary.json"}
        assert {path.name for path in out.iterdir()} == files | kept | set(more)


def test_the_seed_that_was_taken_repeats_a_run(folder: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    """To the byte, at any number of threads."""
    first, again, other = (tmp_path / name for name in ("first", "again", "other"))
    run = "team", "run", "--data", folder, *QUICK, "--json", "--out"
    seed = json.loads(mcloc(*run, first).stdout)["seed"]
    mcloc(*run, again, "--seed", seed, "--threads", 1)
    mcloc(*run, other, "--seed", seed + 1)
    names = sorted(path.name for path in first.iterdir())
    assert len(names) == 8
    assert [(again / n).read_bytes() for n in names] == [(first / n).read_bytes() for n in names]
    assert (other / "robot1.csv").read_bytes() != (first / "robot1.csv").read_bytes()


def test_a_seed_tells_the_same(folder: Path, told: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    for seed, same in (("3", True), ("4", False)):
        options = "--landmarks-for", "1", "--seed", seed, "--json", "--out", tmp_path
        done = mcloc("team", "run", "--data", folder, *options)
        before = json.loads((told / "summary.json").read_text())
        assert (json.loads(done.stdout) == before) is same


def test_without_detections_each_is_alone(folder: Path, mcloc: Mcloc) -> None:
    alone = "team", "run", "--data", folder, "--landmarks-for", "1", "--no-detections", "--json"
    found = json.loads(mcloc(*alone, "--seed", 1).stdout)
    assert found["robots"]["2"] is None
    assert found["robots"]["1"]["position_median_m"] < 0.1
    assert found["detections"] == {"used": 0, "ignored": {}}
    assert found["message_bytes"] == {"median": None, "max": None}
    told_start = json.loads(mcloc(*alone, "--seed", 1, "--told-start").stdout)
    # By the wheels alone: 3 % of 8 rad, around a circle of 1.5 m.
    assert 0.0 < told_start["robots"]["2"]["position_median_m"] < 1.0


def test_people_get_a_table(folder: Path, mcloc: Mcloc) -> None:
    done = mcloc("team", "run", "--data", folder, "--seed", 1)
    assert done.code == 0
    header, *rows = done.stdout.splitlines()
    assert header.split()[:2] == ["robot", "landmarks"]
    assert [row.split()[:2] for row in rows[:3]] == [["1", "yes"], ["2", "yes"], ["3", "yes"]]
    assert all(float(row.split()[2]) < 0.15 for row in rows[:3])
    assert rows[3].startswith("detections ")
    assert any(row.startswith("messages   median") for row in rows)


def test_parts_and_their_parameters_are_set(folder: Path) -> None:
    config = TeamConfig(
        str(folder),
        parts={"filter": "mcl", "size": "fixed"},
        settings={
            "size": {"particles": "150"},
            "detection": {"p_false": "0.2"},
            "team": {"window": 3},
            "sightings": {"sigma_bearing": "0.04"},
        },
        seed=1,
    )
    run = TeamRun(config)
    assert run.team.model.p_false == 0.2
    assert run.team.model.sigma_bearing == 0.04  # one camera sees both
    assert run.team.model.sigma_relative == 0.1
    assert run.team.policy.window == 3.0
    assert len(run.team.robots["2"].belief.particles) == 150
    assert run.team.robots["2"].seed != run.team.robots["1"].seed


WRONG = {
    "no data": ([], "which logs? Give --data FOLDER"),
    "no folder": (["--data", "nowhere"], "is no MRCLAM folder"),
    "no robot": (["--landmarks-for", "7"], "no robot 7, only 1, 2, 3"),
    "no number": (["--landmarks-for", "one"], "takes numbers of robots, such as 1,3"),
    "half a list": (["--landmarks-for", "1,"], "takes numbers of robots"),
    "no filter": (["--filter", "mlc"], "did you mean 'mcl'"),
    "no parameter": (["--set", "detection.sigma=1"], "detection has no parameter 'sigma'"),
    "no value": (["--set", "detection.p_false=2"], "detection.p_false = 2.0 must be"),
    "a camera that sees nothing": (
        ["--set", "sightings.p_outlier=1"],
        "sightings.p_outlier: by it detection.p_false = 1.0 must be > 0 and <= 0.99; set that, too",
    ),
    "no part": (
        ["--set", "detections.p_false=0.1"],
        "unknown part 'detections'; did you mean 'detection'? known: camera, detection, ",
    ),
    "no threads": (["--threads", "0"], "threads must be >= 1, got 0"),
    "no seed": (["--seed", "-1"], "seed must be a whole number from 0 to 2^64 - 1, got -1"),
    "too large a seed": (["--seed", str(2**64)], f"from 0 to 2^64 - 1, got {2**64}"),
    "nobody knows": (["--landmarks-for", "none"], "no robot ever had a place"),
    "kalman anywhere": (["--filter", "kalman"], "say where it starts (--initial, of a team --told"),
}


@pytest.mark.parametrize(("options", "what"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_said_in_one_line(
    folder: Path, options: list[str], what: str, mcloc: Mcloc
) -> None:
    data = [] if "--data" in options or what.startswith("which") else ["--data", folder]
    done = mcloc("team", "run", *data, *options)
    assert done.code == 2
    assert done.stdout == ""
    assert done.stderr.startswith("error: ")
    assert what in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_log_that_is_cut_or_alone_is_refused(folder: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    for file in folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    seen = tmp_path / "Robot3_Measurement.dat"
    seen.write_text(seen.read_text()[:-9])
    done = mcloc("team", "run", "--data", tmp_path)
    assert done.code == 2
    assert "Robot3_Measurement.dat, line" in done.stderr
    (tmp_path / "Robot1_Groundtruth.dat").unlink()
    assert (
        "nobody knows where robot 1 starts"
        in mcloc("team", "run", "--data", tmp_path, "--told-start").stderr
    )
    for robot in (2, 3):
        (tmp_path / f"Robot{robot}_Odometry.dat").unlink()
    assert "a team has 2" in mcloc("team", "run", "--data", tmp_path).stderr


def test_help_teaches(mcloc: Mcloc) -> None:
    assert "mcloc team run --data" in mcloc("team").stdout
    shown = mcloc("team", "run", "--help").stdout
    assert "--landmarks-for" in shown
    assert "NEES, 2.4" in " ".join(shown.split())
