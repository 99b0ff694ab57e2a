"""Robots in processes of their own, by Zenoh on loopback, with every fault that a network, a
computer or a stranger can bring about.
"""

import json
import signal
import subprocess
import sys
import threading
import time
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from tests.team.folders import pose, write_folder
from tests.team.robot_process import SETTINGS, endpoint_file

from mcloc.report.team import TeamConfig
from mcloc.report.team_run import TeamRun
from mcloc.team.letters import Heartbeat, Sent
from mcloc.team.peers import Peers
from mcloc.team.wire import encoded

pytestmark = pytest.mark.slow

LONG = 900.0  # s, for a machine that is busy
PROGRAM = Path(__file__).with_name("robot_process.py")

BOTH = {
    "undisturbed": {},
    "loss": {"loss": 0.25},
    "delay": {"delay": 0.05},
    "twice": {"twice": 1.0},
    "shuffled": {"jitter": 0.08},
}
SCENARIOS = {name: {"faults": {"1": faults, "2": faults}} for name, faults in BOTH.items()}
SCENARIOS |= {
    "clock": {"faults": {"2": {"ahead": 0.2}}},
    "wrong_clock": {"faults": {"2": {"ahead": 3.0}}},
    "rubbish": {},
    "crash": {"faults": {"2": {"dies_after": 5}}, "settings": {"peers": {"silence": 3.0}}},
    "rejoin": {"faults": {"2": {"dies_after": 5}}},
}


def team_in_one_process(folder, seed=0):
    """{robot: (n, 4) t, x, y, θ}, the run."""
    settings = {
        "size": {"particles": 500},
        **{part: SETTINGS[part] for part in ("team",)},
    }
    parts = {"filter": "mcl", "size": "fixed"}
    run = TeamRun(TeamConfig(str(folder), (1,), True, True, parts, settings, seed))
    for _ in run:
        pass
    found = {name: member.history.rows.table[:, :4] for name, member in run.members.items()}
    return run, found


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("folder"), duration=20.0)


@pytest.fixture(scope="module")
def reference(folder):
    """The team in one process, with some seeds."""
    return [team_in_one_process(folder, seed) for seed in (0, 1000, 2000, 3000)]


class Rubbish(threading.Thread):
    """A stranger that says what is malformed or forged, to all and to each. sent: how much."""

    def __init__(self, endpoints):
        super().__init__(daemon=True)
        self.peers = Peers("stranger", "rubbish", connect=endpoints)
        self.end, self.sent = threading.Event(), 0

    def run(self):
        rng = np.random.default_rng(1)
        while not self.end.wait(0.002):
            kinds = [
                rng.bytes(int(rng.integers(0, 3000))),
                b"mcTM" + rng.bytes(200),
                bytes(20_000),
                encoded(Sent("1", 2**63, 5, time.time()), Heartbeat(0.0, 0.0)),
                b"",
            ]
            for to in (None, "1", "2"):
                self.peers.send(kinds[int(rng.integers(len(kinds)))], to)
                self.sent += 1
        self.peers.close()


@pytest.fixture(scope="module")
def results(folder, tmp_path_factory):
    """{scenario: {robot: what it found}}; robot 2 was killed twice on the way, and started anew."""
    out = tmp_path_factory.mktemp("out")
    running = []

    def start(robot, scenarios):
        file = out / f"plan{len(running)}.json"
        plan = {"folder": str(folder), "out": str(out), "scenarios": scenarios}
        file.write_text(json.dumps(plan))
        program = [sys.executable, str(PROGRAM), str(robot), str(file)]
        running.append(subprocess.Popen(program, stderr=subprocess.PIPE, text=True))

    def turn(k, code):
        """Let it go through its scenarios to the end."""
        (out / f"plan{k}.turn").touch()
        ended = running[k].wait(LONG)
        assert ended == code, running[k].stderr.read()

    try:
        start(1, SCENARIOS)
        start(2, {name: SCENARIOS[name] for name in SCENARIOS if name != "rejoin"})
        start(2, {"rejoin": SCENARIOS["rejoin"]})
        start(2, {"rejoin": {}})  # this time it stays alive
        (out / "plan0.turn").touch()
        (out / "plan1.turn").touch()
        stranger = disturbed(out, running[0])
        turn(1, -signal.SIGKILL)
        stranger.end.set()
        turn(2, -signal.SIGKILL)
        turn(3, 0)
        turn(0, 0)
    finally:
        for process in running:
            process.kill()
            process.communicate()
    found = {
        name: {
            n: json.loads((out / f"{name}.{n}.json").read_text())
            for n in "12"
            if (out / f"{name}.{n}.json").exists()
        }
        for name in SCENARIOS
    }
    found["rubbish"]["sent"] = stranger.sent
    return found


def disturbed(out, one):
    """A stranger, as soon as there is somebody to disturb."""
    end, file = time.monotonic() + LONG, endpoint_file(out, "rubbish")
    while not file.exists():
        assert one.poll() is None, one.stderr.read()
        assert time.monotonic() < end
        time.sleep(0.01)
    stranger = Rubbish([file.read_text()])
    stranger.start()
    return stranger


def apart(a, b):
    """m: root mean square distance at common stamps."""
    places = [{round(t, 3): np.array([x, y]) for t, x, y, *_ in table} for table in (a, b)]
    common = sorted(set(places[0]) & set(places[1]))
    assert len(common) > 10
    return np.sqrt(np.mean([((places[0][t] - places[1][t]) ** 2).sum() for t in common]))


def near(reference, robot, estimates):
    """Whether it is no farther from the team in one process than twice what seeds differ by."""
    found = [tables[robot] for _, tables in reference]
    between_seeds = [apart(a, b) for a, b in combinations(found, 2)]
    return apart(found[0], estimates) < 2.0 * max(between_seeds)


@pytest.mark.parametrize("name", [*BOTH, "clock", "rubbish"])
def test_beliefs_are_those_of_one_process_whatever_happens_to_messages(name, results, reference):
    used = reference[0][0].team.used
    assert used > 2
    for robot in "12":
        found = results[name][robot]
        assert found["sound"]
        assert found["detections"]["used"] == used
        assert found["undelivered"] == 0
        assert found["messages"]["dropped"].get("lost on the way", 0) == 0
        assert near(reference, robot, found["estimates"])


def test_without_faults_nothing_is_dropped(results):
    for robot in "12":
        dropped = results["undisturbed"][robot]["messages"]["dropped"]
        assert set(dropped) <= {"duplicate"}  # of a busy machine, after which it was sent again


def test_duplicates_are_counted(results):
    for robot, other in ("12", "21"):
        dropped = results["twice"][robot]["messages"]["dropped"]
        assert dropped["duplicate"] >= results["twice"][other]["letters"]


def test_rubbish_is_counted_by_reason(results):
    """Zenoh may leave out some of what comes too fast, and nothing more."""
    for robot in "12":
        dropped = results["rubbish"][robot]["messages"]["dropped"]
        for why in ("too long", "too short", "no message of mcloc", "of another version"):
            assert dropped[why] > 0
        assert dropped["under the name of another robot"] > 0
        assert sum(dropped.values()) <= results["rubbish"]["sent"] + dropped.get("duplicate", 0)


def test_offsets_of_clocks_are_found(results):
    ahead = results["clock"]["1"]["peers"]["2"]["clock_ahead_s"]
    assert ahead == pytest.approx(0.2, abs=0.15)
    assert results["clock"]["2"]["peers"]["1"]["clock_ahead_s"] == pytest.approx(-0.2, abs=0.15)


def test_a_clock_that_is_too_far_off_is_not_believed(results):
    for robot in "12":
        found = results["wrong_clock"][robot]
        assert found["sound"]
        assert found["detections"]["used"] == 0
    ignored = results["wrong_clock"]["1"]["detections"]["ignored"]
    assert ignored["detection of a robot whose clock is not trusted"] > 0
    assert results["wrong_clock"]["1"]["peers"]["2"]["clock_ahead_s"] == pytest.approx(3.0, abs=0.4)


def test_a_robot_that_is_killed_holds_nobody_up(results):
    assert "2" not in results["crash"]
    one = results["crash"]["1"]
    assert one["sound"]
    assert one["detections"]["used"] > 0
    t, *_ = one["estimates"][-1]
    assert t > 1018.0
    errors = [np.hypot(*(np.array(e[1:3]) - pose(1, e[0] - 1000.0)[:2])) for e in one["estimates"]]
    assert np.median(errors) < 0.2


def test_a_robot_that_was_killed_joins_again(results):
    one, two = results["rejoin"]["1"], results["rejoin"]["2"]
    assert one["peers"]["2"]["starts"] == 2
    assert two["events_before"] > 0
    assert two["started_globally"]
    assert one["sound"]
    assert two["sound"]
    assert one["estimates"][-1][0] > 1018.0
