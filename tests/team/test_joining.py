"""Robots that replay their logs by themselves, and tell each other: as a Team in one process does,
whatever becomes of the messages between them.
"""

import math
import threading
import time
from collections import Counter
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from tests.team.folders import write_folder
from tests.team.hub import Faults, Faulty, Hub
from tests.team.robots import MODEL, QUICK, alone, apart, errors, events, sound, together

from mcloc.events import Detection, Odometry
from mcloc.team.inbox import Arrival
from mcloc.team.letters import Heartbeat, Sent
from mcloc.team.peer_policy import PeerPolicy
from mcloc.team.post import Post
from mcloc.team.wire import decoded, encoded

LONG = 600.0  # s, for a machine that is busy


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("folder"), duration=30.0)


@pytest.fixture(scope="module")
def team(folder):
    """The Team in one process, with several seeds."""
    return [together(folder, seed=seed) for seed in range(4)]


def run(*robots, peers=1):
    """Let them go, each in a thread of its own."""
    threads = [threading.Thread(target=robot.go, args=(peers,), daemon=True) for robot in robots]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LONG)
    assert all(robot.ended for robot in robots)
    assert all(sound(robot.member.localizer.belief.particles) for robot in robots)


def pair(folder, faults=None, policy=QUICK):
    """Two robots with faults in what each of them sends."""
    hub = Hub()
    carriers = [Faulty(hub.carrier(str(n)), faults or Faults(), seed=n) for n in (1, 2)]
    robots = [alone(folder, n, c, policy) for n, c in zip((1, 2), carriers, strict=True)]
    return robots, carriers


def test_beliefs_are_those_of_the_team_in_one_process(folder, team):
    """They are no farther from it than twice what seeds differ by. Random numbers are the same as
    long as steps come in the same order, which depends on when a letter arrives.
    """
    robots, _ = pair(folder)
    run(*robots)
    in_one, found = team[0]
    assert in_one.used > 3
    assert [robot.member.used for robot in robots] == [in_one.used] * 2
    again = sum((robot.member.ignored for robot in robots), start=type(in_one.ignored)())
    assert again == in_one.ignored
    for n, robot in zip("12", robots, strict=True):
        assert set(robot.dropped) <= {"duplicate"}  # where the machine was busy
        other_seeds = [apart(a[n], b[n]) for (_, a), (_, b) in combinations(team, 2)]
        assert apart(robot.estimates, found[n]) < 2.0 * max(other_seeds)
    assert np.median(errors(robots[1].estimates[-10:], 2)) < 0.3


@pytest.mark.parametrize(
    "faults",
    [
        Faults(loss=0.3),
        Faults(delay=0.05),
        Faults(twice=1.0),
        Faults(jitter=0.1),
        Faults(loss=0.2, twice=0.3, jitter=0.05),
    ],
    ids=["loss", "delay", "twice", "shuffled", "all"],
)
def test_messages_may_be_lost_late_twice_and_shuffled(folder, team, faults):
    """Nothing is given up here, so that beliefs are those without faults."""
    robots, carriers = pair(folder, faults)
    run(*robots)
    in_one, found = team[0]
    assert [robot.member.used for robot in robots] == [in_one.used] * 2
    for n, robot, other in zip("12", robots, carriers[::-1], strict=True):
        other_seeds = [apart(a[n], b[n]) for (_, a), (_, b) in combinations(team, 2)]
        assert apart(robot.estimates, found[n]) < 2.0 * max(other_seeds)
        assert other.letters == other.delivered  # each was sent until it came
        dropped = robot.dropped
        assert dropped.pop("lost on the way", 0) == 0
        if faults.twice == 1.0:
            assert dropped.pop("duplicate") >= len(other.letters)
        elif faults.twice or faults.loss or faults.jitter or faults.delay:
            dropped.pop("duplicate", 0)
        late = {"answer that came too late", "after its farewell", "of a clock not compared yet"}
        assert set(dropped) <= late


def test_what_is_lost_for_good_is_counted(folder):
    """A notice that is never answered costs the wait for it, and no more."""
    policy = PeerPolicy(patience=600.0, silence=600.0, reply_wait=0.3, again=60.0, heartbeat=0.05)
    robots, carriers = pair(folder, Faults(), policy)
    carriers[0].faults.loss = 0.0
    letters = [0]

    def some_are_lost(data, to, send=carriers[0].send):
        if to is not None and not isinstance(decoded(data)[1], Heartbeat):
            letters[0] += 1
            if letters[0] % 3 == 0:
                return
        send(data, to)

    carriers[0].send = some_are_lost
    run(*robots)
    assert robots[1].dropped["lost on the way"] == letters[0] // 3 > 2
    assert robots[0].member.ignored["detection without an answer"] > 0


def test_who_is_gone_is_not_waited_for(folder):
    """Robot 2 falls silent in the middle, without a farewell."""
    policy = PeerPolicy(patience=600.0, silence=3.0, reply_wait=600.0, heartbeat=0.05)
    (one, two), (_, carrier) = pair(folder, policy=policy)

    class CrashError(Exception):
        pass

    def crash():
        carrier.faults.loss = 1.0
        raise CrashError

    carrier.kill, carrier.faults.dies_after = crash, 8
    crashed = []

    def until_it_crashes():
        try:
            two.go(1)
        except CrashError:
            crashed.append(True)

    thread = threading.Thread(target=until_it_crashes, daemon=True)
    thread.start()
    run(one)
    thread.join(LONG)
    assert crashed == [True]
    assert one.member.used > 0
    assert one.member.ignored["detection of a robot that is not heard"] > 0
    assert np.median(errors(one.estimates, 1)) < 0.2


def test_who_starts_anew_joins_where_the_others_are(folder):
    """Robot 2 crashes, robot 1 waits for it, and a new process takes part to the end."""
    hub = Hub()
    one = alone(folder, 1, hub.carrier("1"))
    first = Faulty(hub.carrier("2"), Faults(dies_after=8), kill=threading.Event().wait)
    two = alone(folder, 2, first)
    for robot in (one, two):
        threading.Thread(target=robot.go, args=(1,), daemon=True).start()
    end = time.monotonic() + LONG
    while len(first.letters) < 8:
        assert time.monotonic() < end
        time.sleep(0.01)
    first.faults.loss = 1.0  # the pulse of the first process beats on, unheard
    again = alone(folder, 2, hub.carrier("2"), seed=1)
    run(again)
    while not one.ended:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert again.joining.skipped > 0
    assert again.member.used > 0
    assert one.member.post.inbox.peers["2"].sessions == 2
    assert not again.member.localizer.told_start  # it has moved since
    assert all(e.t >= again.estimates[0].t > 1001.0 for e in again.estimates)


@pytest.mark.parametrize("ahead", [0.3, -0.3, 2.0, -2.0])
def test_clocks_may_be_apart_by_a_bound(folder, team, ahead):
    hub = Hub()
    one = alone(folder, 1, hub.carrier("1"))
    two = alone(folder, 2, Faulty(hub.carrier("2"), Faults(ahead=ahead)))
    run(one, two)
    offset = one.member.post.inbox.peers["2"].offset
    assert offset.low <= ahead <= offset.high
    if abs(ahead) < 0.5:
        assert one.member.used == two.member.used == team[0][0].used
        return
    assert one.member.used == two.member.used == 0
    for robot in (one, two):
        reasons = set(robot.member.ignored)
        assert "detection of a robot whose clock is not trusted" in reasons
        # One of them may end, with all that it could not use, before the other.
        assert not reasons - {
            "detection of a robot whose clock is not trusted",
            "detection of a robot that is not heard",
        }


def test_rubbish_between_messages_changes_nothing(folder, team):
    """A robot of the team sends what is malformed, forged and far too much; the two count it."""
    (one, two), (carrier, _) = pair(folder)
    evil = carrier.carrier.hub.carrier("3")
    rng = np.random.default_rng(1)
    end = threading.Event()
    sent = [0]

    def attack():
        while not end.wait(0.002):
            kinds = [
                rng.bytes(int(rng.integers(0, 4000))),
                b"mcTM" + rng.bytes(100),
                bytes(100_000),
                encoded(Sent("1", 2**63, 5, time.time()), Heartbeat(0.0, 0.0)),
            ]
            evil.send(kinds[int(rng.integers(len(kinds)))], None)
            sent[0] += 1

    threading.Thread(target=attack, daemon=True).start()
    run(one, two)
    end.set()
    in_one, found = team[0]
    assert one.member.used == two.member.used == in_one.used
    for robot, n in ((one, "1"), (two, "2")):
        other_seeds = [apart(a[n], b[n]) for (_, a), (_, b) in combinations(team, 2)]
        assert apart(robot.estimates, found[n]) < 2.0 * max(other_seeds)
        assert 0 < robot.dropped.total() - robot.dropped["duplicate"] <= sent[0] + 5
        assert robot.dropped["under the name of another robot"] > 0
        assert robot.dropped["too long"] > 0


def stop_and_go(n, t0=1000.0):
    """Odometry of a robot that drives straight on, n seconds."""
    return [Odometry(t0 + 0.5 * k, np.array([0.1 * k, 0.0, 0.0])) for k in range(2 * n)]


def spoilt(log):
    """With one wrong stamp of the wheels."""
    k = next(i for i, e in enumerate(log) if isinstance(e, Odometry) and i > 20)
    return [*log[:k], Odometry(log[k].t + 1e6, log[k].pose), *log[k + 1 :]]


def test_one_wrong_stamp_of_wheels_is_not_where_a_robot_is(folder):
    one = alone(folder, 1, Hub().carrier("1"), log=spoilt(list(events(folder, 1))))
    told = []
    for _ in one.joining.run():
        told.append(one.member.post.position)
    assert 1000.0 < max(told) < 1100.0
    assert told == sorted(told)


def test_after_one_wrong_stamp_a_robot_still_follows_its_wheels(folder):
    whole = [Odometry(1000.0 + 0.5 * k, np.array([0.1 * k, 0.0, 0.0])) for k in range(200)]
    robots = [alone(folder, 2, Hub().carrier("2"), log=log) for log in (whole, spoilt(whole))]
    for robot in robots:
        robot.go(0)
    assert abs(len(robots[0].estimates) - len(robots[1].estimates)) <= 1
    assert len(robots[0].estimates) > 3


def merged(*streams):
    return sorted((e for stream in streams for e in stream), key=lambda e: e.t)


def test_two_that_see_each_other_at_once_use_one_sighting(folder):
    sees = [Detection(1005.0, "2", 2.0, 0.3)], [Detection(1005.0, "1", 2.0, 0.1)]
    hub = Hub()
    robots = [
        alone(folder, n, hub.carrier(str(n)), log=merged(stop_and_go(10), sees[n - 1]))
        for n in (1, 2)
    ]
    run(*robots)
    assert [robot.member.used for robot in robots] == [1, 1]
    ignored = robots[0].member.ignored + robots[1].member.ignored
    assert ignored == {"detection of the same robots again": 1}


def test_what_cannot_be_used_is_counted(folder):
    spoilt = [
        Detection(math.nan, "2", 2.0, 0.3),
        Detection(1001.0, "1", 2.0, 0.3),
        Detection(1002.0, "2", -1.0, 0.3),
        Detection(1003.0, "4", 2.0, 0.3),
        Detection(1004.0, "2", 2.0, 0.3),
        Detection(1005.0, "2", 2.0, 0.3),
        Detection(1050.0, "2", 2.0, 0.3),
    ]
    hub = Hub()
    one = alone(folder, 1, hub.carrier("1"), log=[spoilt[0], *merged(stop_and_go(60), spoilt[1:])])
    two = alone(folder, 2, hub.carrier("2"), log=stop_and_go(10))
    run(one, two)
    assert one.member.used == two.member.used == 1
    never = "detection of a robot that is not heard"
    of_others = {
        "detection stamp not finite": 1,
        "detection of the robot itself": 1,
        "detection without a range that can be": 1,
        never: 1,
        "detection of the same robots again": 1,
    }
    # Of the one that is over: it has said so by then, or answers for the last time.
    of_one_that_is_over = one.member.ignored - Counter(of_others)
    assert one.member.ignored - of_one_that_is_over == of_others
    assert list(of_one_that_is_over.elements()) in ([never], ["detection without odometry"])


def test_who_does_not_go_on_is_not_waited_for_for_ever(folder):
    """It beats, but never comes on."""
    policy = PeerPolicy(patience=3.0, silence=600.0, heartbeat=0.05)
    hub = Hub()
    stuck = alone(folder, 2, hub.carrier("2"), policy)
    end = threading.Event()
    stuck.member.post.until = 1003.0

    def beat():
        while not end.wait(0.02):
            stuck.member.post.serve()
            stuck.member.post.beat()

    threading.Thread(target=beat, daemon=True).start()
    one = alone(folder, 1, hub.carrier("1"), policy, log=stop_and_go(20))
    run(one)
    end.set()
    assert one.joining.not_awaited == {"2": 1}


CREEPING = {
    "from the first days": lambda t: -1e9 + t,
    "behind": lambda t: 1000.0 + 1e-3 * t,
    "from minus infinity": lambda _: -math.inf,
}


@pytest.mark.parametrize("how", CREEPING)
def test_who_says_to_go_on_and_never_comes_is_not_waited_for_for_ever(folder, stranger, how):
    hub, began = Hub(), time.monotonic()
    stranger(hub, "3", lambda post: (-math.inf, CREEPING[how](post.now() - began)))
    policy = PeerPolicy(patience=1.0, silence=600.0, heartbeat=0.05)
    one = alone(folder, 1, hub.carrier("1"), policy, log=stop_and_go(20))
    run(one)
    assert one.joining.not_awaited["3"] >= 1


@pytest.fixture
def stranger():
    """Starts one that is heard by all, and says to be wherever it is told to."""
    end, threads = threading.Event(), []

    def start(hub, name, where):
        post = Post(name, hub.carrier(name), QUICK)

        def beat():
            while not end.wait(0.02):
                post.serve()
                post.position, post.until = where(post)
                post.beat()

        threads.append(threading.Thread(target=beat, daemon=True))
        threads[-1].start()
        return post

    yield start
    end.set()
    for thread in threads:
        thread.join()


@pytest.mark.parametrize("until", [math.inf, -math.inf, 1e9, math.nan])
def test_who_says_to_be_beyond_the_log_does_not_end_it(folder, stranger, until):
    hub = Hub()
    stranger(hub, "3", lambda _: (1e9, until))
    policy = PeerPolicy(patience=2.0, silence=600.0, heartbeat=0.05)
    one = alone(folder, 1, hub.carrier("1"), policy, log=stop_and_go(20))
    one.go(1)
    assert one.joining.beyond == {"3": 1}
    assert one.joining.skipped == 0
    assert one.member.post.position == stop_and_go(20)[-1].t
    assert one.member.localizer.told_start


def test_the_farthest_one_within_the_log_is_joined(folder, stranger):
    hub = Hub()
    for name, position in (("3", 1e9), ("4", 1010.0), ("5", 1005.0), ("6", -math.inf)):
        stranger(hub, name, lambda _, position=position: (position, math.inf))
    one = alone(folder, 1, hub.carrier("1"), log=stop_and_go(20))
    one.go(4)
    assert one.joining.beyond == {"3": 1}
    assert one.joining.skipped == 20


@pytest.fixture
def acquainted():
    """Two robots without logs that know each other's clocks; the second one answers."""
    end = threading.Event()

    def start(folder):
        hub = Hub()
        robots = [alone(folder, n, hub.carrier(str(n)), log=[]) for n in (1, 2)]
        one, two = (robot.member for robot in robots)
        for _ in range(2):
            for member in (one, two):
                member.post.beat()
                one.post.serve()
                two.post.serve()

        def answer():
            while not end.is_set():
                two.post.serve(wait=0.01)
                two.answer_due(math.inf)

        threading.Thread(target=answer, daemon=True).start()
        return one, two

    yield start
    end.set()


def test_a_robot_with_another_detection_model_is_spoken_of_and_not_waited_for(folder):
    """Neither asks, so neither waits for an answer; each says so once. One of them may end before
    the other sees anything.
    """
    hub, said = Hub(), [[], []]
    models = MODEL, replace(MODEL, p_false=0.3)
    robots = [
        alone(folder, n, hub.carrier(str(n)), model=model, say=of.append)
        for n, model, of in zip((1, 2), models, said, strict=True)
    ]
    run(*robots)
    for robot, remarks, other in zip(robots, said, "21", strict=True):
        assert robot.member.used == 0
        assert robot.member.post.sizes == []
        (remark,) = remarks
        assert f"robot {other} has another detection model" in remark
    ignored = robots[0].member.ignored + robots[1].member.ignored
    assert ignored.pop("detection of a robot with another detection model") > 0
    assert set(ignored) <= {"detection of a robot that is not heard"}


def test_who_begins_without_those_that_it_waited_for_says_so(folder):
    said = []
    alone(folder, 1, Hub().carrier("1"), PeerPolicy(patience=0.1), say=said.append).go(3)
    assert said == ["1 begins with 0 of the 3 others that it waited for"]


def test_another_robot_of_the_same_name_is_spoken_of_once(folder):
    hub, said = Hub(), []
    one = alone(folder, 1, hub.carrier("1"), say=said.append)
    namesake = Sent("1", one.member.post.inbox.session + 1, 0, time.time())
    for _ in range(3):
        arrival = Arrival(encoded(namesake, Heartbeat(0.0, 0.0)), "1", time.time(), 0.0)
        hub.robots["1"].waiting.append(arrival)
    one.go(0)
    assert one.dropped == {"of another robot of this name": 3}
    (remark,) = said
    assert "another robot is called 1, too" in remark


REFUSED = {
    "late": (stop_and_go(10), 1009.4, True),
    "without odometry": ([], -math.inf, True),
    "between robots that have no place yet": (stop_and_go(10), -math.inf, False),
}


@pytest.mark.parametrize("why", REFUSED)
def test_a_notice_that_is_refused(folder, acquainted, why):
    one, two = acquainted(folder)
    wheels, done, placed = REFUSED[why]
    for event in stop_and_go(10):
        one.process(event)
    for event in wheels:
        two.process(event)
    two.localizer._queue.done = done
    if not placed:
        one.localizer.start_globally()
        two.localizer.start_globally()
    one.process(Detection(1009.2, "2", 2.0, 0.3))
    assert one.ignored == {f"detection {why}": 1}
    assert one.used == two.used == 0


def test_who_has_no_place_is_told_and_tells_nothing(folder, acquainted):
    one, two = acquainted(folder)
    two.localizer.start_globally()
    for event in stop_and_go(10):
        one.process(event)
        two.process(event)
    one.taken()
    one.process(Detection(1009.2, "2", 2.0, 0.3))
    assert one.used == 1
    assert not one.found
    end = time.monotonic() + LONG
    while not two.found:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert two.taken()[0][0].measurement.source == "robot 1"


def test_what_this_robot_is_too_late_for_it_does_not_tell(folder, acquainted):
    one, _ = acquainted(folder)
    one.process(Detection(1009.2, "2", 2.0, 0.3))
    for event in stop_and_go(10):
        one.process(event)
    one.localizer._queue.done = 1009.4
    one.process(Detection(1009.2, "2", 2.0, 0.3))
    assert one.ignored == {"detection without odometry": 1, "detection late": 1}
