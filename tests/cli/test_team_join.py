"""`mcloc team join`: what one robot does, alone and with another one beside it."""

import json
import threading

import numpy as np
import pytest
from tests.cli.conftest import Mcloc
from tests.team.folders import write_folder
from tests.team.hub import Hub

from mcloc.config import RunConfig
from mcloc.report.joined import Joined, JoinedRun

QUICK = ("--filter", "mcl", "--size", "fixed", "--particles", 300, "--no-plot", "--threads", 1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("folder"), duration=20.0)


def test_alone_a_robot_is_localized_and_says_whom_it_did_not_hear(
    mcloc: Mcloc, folder, tmp_path
) -> None:
    arguments = ("team", "join", "--data", folder, "--robot", 1, "--told-start", *QUICK)
    done = mcloc(*arguments, "--seed", 1, "--out", tmp_path)
    assert done.code == 0, done.stderr
    assert "1 listens at tcp/127.0.0.1:" in done.stderr
    assert "team       0 detections used, by and of 1" in done.stdout
    assert "× detection of a robot that is not heard" in done.stdout
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["accuracy"]["position_median_m"] < 0.2
    assert summary["team"]["name"] == "1"
    assert summary["team"]["messages"] == {"dropped": {}}
    assert (tmp_path / "trajectory.tum").exists()
    assert (tmp_path / "config.yaml").exists()
    done = mcloc(*arguments, "--seed", 1, "--out", tmp_path, "--json")
    assert json.loads(done.stdout)["final"] == summary["final"]


def test_a_log_with_a_map_and_a_file_of_detections(mcloc: Mcloc, drive, start, tmp_path) -> None:
    (tmp_path / "seen.csv").write_text("t,seen,range,bearing\n3.0,r2,2.0,0.1\n4.0,r2,2.0,0.1\n")
    done = mcloc(
        *("team", "join", "--name", "r1", "--map", drive / "map.yaml", "--log", drive / "log.gz"),
        *("--detections", tmp_path / "seen.csv", "--initial", start, "--out", tmp_path / "out"),
        *("--truth", drive / "truth.csv", "--seed", 1, "--no-plot", "--json"),
    )
    assert done.code == 0, done.stderr
    summary = json.loads(done.stdout)
    ignored = summary["team"]["detections"]["ignored"]
    assert ignored == {"detection of a robot that is not heard": 2}
    assert summary["accuracy"]["position_median_m"] < 0.3


def test_a_robot_says_that_it_begins_without_others(mcloc: Mcloc, folder, tmp_path) -> None:
    done = mcloc(
        *("team", "join", "--data", folder, "--robot", 1, "--told-start", *QUICK),
        *("--peers", 2, "--set", "peers.patience=0.2", "--seed", 1, "--out", tmp_path),
    )
    assert done.code == 0, done.stderr
    assert "1 begins with 0 of the 2 others" in done.stderr


WRONG = {
    "what is the robot called": ["--map", "m.yaml", "--log", "l.gz"],
    "which log": ["--name", "r1"],
    "give one": ["--data", "x", "--robot", "1", "--log", "l.gz"],
    "is called 1": ["--data", "x", "--robot", "1", "--name", "r1"],
    "which robot": ["--name", "1", "--data", "FOLDER"],
    "there is no robot 7": ["--data", "FOLDER", "--robot", "7"],
    "name with characters": ["--data", "FOLDER", "--robot", "1", "--team", "a/b"],
    "no endpoint such as": ["--data", "FOLDER", "--robot", "1", "--listen", "here"],
    "leave it 0": ["--data", "FOLDER", "--robot", "1", "--set", "detection.p_detect=0.5"],
    "peers has no parameter": ["--data", "FOLDER", "--robot", "1", "--set", "peers.silense=3"],
    "for '--peers'": ["--data", "FOLDER", "--robot", "1", "--peers", "-1"],
    "must be > 0": ["--data", "FOLDER", "--robot", "1", "--set", "peers.silence=0"],
}


@pytest.mark.parametrize("why", WRONG)
def test_what_is_wrong_is_said(mcloc: Mcloc, folder, tmp_path, why) -> None:
    arguments = [folder if word == "FOLDER" else word for word in WRONG[why]]
    done = mcloc("team", "join", *arguments, "--out", tmp_path)
    assert done.code == 2
    assert why in done.stderr


def test_told_start_is_of_an_mrclam_folder(mcloc: Mcloc, drive, tmp_path) -> None:
    done = mcloc(
        *("team", "join", "--name", "r1", "--map", drive / "map.yaml", "--told-start"),
        *("--log", drive / "log.gz", "--out", tmp_path),
    )
    assert done.code == 2
    assert "--initial" in done.stderr


def config(folder, robot):
    return RunConfig(
        None,
        str(folder),
        robot=robot,
        filter="mcl",
        size="fixed",
        seed=robot,
        settings={"size": {"particles": 300}},
    )


PATIENT = {"peers": {"patience": 600.0, "silence": 600.0, "reply_wait": 600.0}}


def test_two_that_join_are_told(folder) -> None:
    """As the command has it, but for the carrier, and in threads; robot 2 has wheels alone."""
    hub = Hub()
    runs = [
        JoinedRun(
            config(folder, n),
            Joined(str(n), 1, None, n == 1, True, PATIENT),
            hub.carrier(str(n)),
        )
        for n in (1, 2)
    ]
    threads = [threading.Thread(target=lambda run=run: list(run), daemon=True) for run in runs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(600.0)
        assert not thread.is_alive()
    one, two = (run.more()["team"] for run in runs)
    assert one["detections"]["used"] == two["detections"]["used"] > 0
    assert one["peers"]["2"]["starts"] == 1
    assert 0 < one["message_bytes"]["median"] <= one["message_bytes"]["max"] < 4500
    assert one["events_before"] == 0
    for run in runs:
        table = run.history.rows.table
        assert np.isfinite(table[:, :4]).all()
        assert run.landmarks is None or run is runs[0]


def test_robots_that_are_set_differently_are_told_apart(folder) -> None:
    hub, said = Hub(), ([], [])
    settings = PATIENT, {**PATIENT, "detection": {"p_false": 0.3}}
    runs = [
        JoinedRun(
            config(folder, n),
            Joined(str(n), 1, None, n == 1, True, of),
            hub.carrier(str(n)),
            remarks.append,
        )
        for n, of, remarks in zip((1, 2), settings, said, strict=True)
    ]
    threads = [threading.Thread(target=lambda run=run: list(run), daemon=True) for run in runs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(600.0)
        assert not thread.is_alive()
    for run, remarks, other in zip(runs, said, "21", strict=True):
        told = run.more()["team"]
        assert told["detections"]["used"] == 0
        assert told["peers"][other]["differing"] == ["detection"]
        assert len(remarks) == 1


def test_a_robot_that_never_has_a_place_says_so(folder) -> None:
    run = JoinedRun(config(folder, 2), Joined("2", 0, None, False), Hub().carrier("2"))
    with pytest.raises(Exception, match="never had a place"):
        list(run)
