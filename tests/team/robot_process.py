"""A robot in a process of its own, for tests: `python robot_process.py ROBOT PLAN.json`.

The plan holds the folder of the logs, where to put results, and scenarios that are gone through one
after the other: each a team of its own, with faults in what this robot sends. It begins when there
is a PLAN.turn.
"""

import json
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from mcloc.config import RunConfig
from mcloc.report.joined import Joined, JoinedRun
from mcloc.team.peers import LOOPBACK, Peers

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.team.hub import Faults, Faulty
from tests.team.robots import sound

SETTINGS = {
    "peers": {"patience": 600.0, "silence": 600.0, "reply_wait": 600.0, "again": 0.2},
    "team": {"window": 4.0, "distance": 1.0},
}
LONG = 900.0  # s


def config(folder, robot, seed=0):
    return RunConfig(
        None,
        str(folder),
        robot=robot,
        filter="mcl",
        size="fixed",
        seed=seed + robot,
        threads=1,
        settings={"size": {"particles": 500}},
    )


def endpoint_file(out, scenario):
    return out / f"{scenario}.endpoint"


def wait_for(file):
    end = time.monotonic() + LONG
    while not file.exists():
        assert time.monotonic() < end, f"{file} never came"
        time.sleep(0.02)


def connected(out, robot, scenario):
    """Robot 1 says where it listens; the others read it."""
    file = endpoint_file(out, scenario)
    if robot == 1:
        peers = Peers("1", scenario, listen=[LOOPBACK])
        file.with_suffix(".new").write_text(peers.listening[0])
        file.with_suffix(".new").rename(file)
        return peers
    wait_for(file)
    return Peers(str(robot), scenario, connect=[file.read_text()])


def go(folder, out, robot, scenario, faults, settings, peers):
    """Go through the log once; what came of it."""
    carrier = Faulty(
        connected(out, robot, scenario),
        Faults(**faults),
        seed=robot,
        kill=lambda: os.kill(os.getpid(), signal.SIGKILL),
    )
    merged = {part: {**of, **settings.get(part, {})} for part, of in SETTINGS.items()}
    joined = Joined(str(robot), peers, None, robot == 1, True, merged)
    run = JoinedRun(config(folder, robot), joined, carrier)
    for _ in run.by_event():
        pass
    time.sleep(0.1 + faults.get("delay", 0.0) + faults.get("jitter", 0.0))  # the last ones leave
    carrier.close()
    undelivered = len(carrier.letters - carrier.delivered)
    return {
        **run.more()["team"],
        "estimates": np.round(run.history.rows.table[:, :4], 6).tolist(),
        "sound": bool(sound(run.localizer.belief.particles)),
        "letters": len(carrier.letters),
        "undelivered": undelivered,
        "started_globally": not run.localizer.told_start,
    }


def main():
    robot, plan = int(sys.argv[1]), json.loads(Path(sys.argv[2]).read_text())
    folder, out = Path(plan["folder"]), Path(plan["out"])
    wait_for(Path(sys.argv[2]).with_suffix(".turn"))
    for name, scenario in plan["scenarios"].items():
        faults = scenario.get("faults", {}).get(str(robot), {})
        settings = scenario.get("settings", {})
        found = go(folder, out, robot, name, faults, settings, scenario.get("peers", 1))
        file = out / f"{name}.{robot}.json"
        file.with_suffix(".new").write_text(json.dumps(found))
        file.with_suffix(".new").rename(file)


if __name__ == "__main__":
    main()
