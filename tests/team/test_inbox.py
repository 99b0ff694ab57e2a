"""The rules by which messages are judged, with time in hand: no transport, no clock."""

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.team.conftest import place, ring

from mcloc.events import Detection
from mcloc.team import wire
from mcloc.team.inbox import Arrival, Inbox
from mcloc.team.letters import MOST_HEARD, Common, Farewell, Heartbeat, Notice, Refusal, Reply, Sent
from mcloc.team.numbering import REMEMBERED
from mcloc.team.outbox import Outbox
from mcloc.team.peer_policy import PeerPolicy
from mcloc.team.wire import encoded

POLICY = PeerPolicy()
BEGAN = 1_000.0  # s, by the true clock
TREE, RING = place(100), ring(100)


class Ether:
    """Two or more robots in one time. ahead: s, of each robot's clock."""

    def __init__(self, **ahead):
        self.t, self.ahead = BEGAN, ahead
        self.inboxes, self.outboxes, self.sent = {}, {}, []
        for name in ahead:
            self.start(name)

    def start(self, name):
        session = int(self.clock(name) * 1e9)
        self.inboxes[name] = Inbox(name, session, POLICY)
        self.outboxes[name] = Outbox(name, session, Sender(self, name))

    def clock(self, name):
        return self.t + self.ahead[name]

    def arrival(self, data, sender, at):
        return Arrival(data, sender, self.clock(at), self.t)

    def deliver(self, data, sender, at):
        return self.inboxes[at].take(self.arrival(data, sender, at))

    def beat(self, name, until=math.nan, position=-math.inf):
        box = self.outboxes[name]
        inbox = self.inboxes[name]
        box.to_all(Heartbeat(position, until, inbox.heard(self.t, box.told), inbox.common))

    def meet(self, delay=0.01):
        """Until all have compared their clocks."""
        for _ in range(2):
            for name in self.ahead:
                self.beat(name)
                self.t += delay
                self.flush()

    def flush(self):
        """Deliver all that was sent; what came of it, by the receiver."""
        came = {name: [] for name in self.inboxes}
        waiting, self.sent = self.sent, []
        for data, sender, to in waiting:
            for name in self.inboxes:
                if name != sender and to in (None, name):
                    came[name].append(self.deliver(data, sender, name))
        return came

    def session(self, name):
        return self.inboxes[name].session


class Sender:
    def __init__(self, ether, name):
        self.ether, self.name = ether, name

    def clock(self):
        return self.ether.clock(self.name)

    def send(self, data, to):
        self.ether.sent.append((data, self.name, to))

    def arrived(self):
        return []

    def dropped(self):
        return 0

    def close(self):
        pass


def notice(seen="b", t=5.0):
    return Notice(Detection(t, seen, 3.0, 0.4), -math.inf, math.inf, TREE)


def from_a(ether, said=None):
    ether.outboxes["a"].to_one("b", ether.session("b"), said or notice())


@pytest.fixture
def two():
    ether = Ether(a=0.0, b=0.0)
    ether.meet()
    return ether


def test_a_notice_and_its_reply_pass(two):
    from_a(two)
    ((sent, said),) = two.flush()["b"]
    assert (sent.sender, said.z.seen, said.z.t) == ("a", "b", 5.0)
    two.outboxes["b"].to_one(
        "a", sent.session, Reply("a", sent.session, sent.number, 5.0, 1.0, RING)
    )
    ((_, reply),) = two.flush()["a"]
    assert (reply.number, reply.session) == (sent.number, two.session("a"))
    assert not two.inboxes["a"].dropped
    assert not two.inboxes["b"].dropped


def test_duplicates_are_left_out_and_counted(two):
    from_a(two)
    (data, *_) = two.sent[0]
    assert two.flush()["b"] != [None]
    for _ in range(3):
        assert two.deliver(data, "a", "b") is None
    assert two.inboxes["b"].dropped == {"duplicate": 3}
    assert two.inboxes["b"].peers["a"].missing == 0


def test_what_comes_twice_is_not_read_again(two, monkeypatch):
    """A replay of letters must cost less than reading their trees does."""
    from_a(two)
    (data, *_) = two.sent[0]
    two.flush()
    monkeypatch.setattr(wire, "unpacked", lambda *_: pytest.fail("a tree was read"))
    two.deliver(data, "a", "b")
    for session, key in ((two.session("a") - 1, "a"), (two.session("a"), "c")):
        two.deliver(encoded(Sent("a", session, 7, two.t), notice()), key, "b")
    assert two.inboxes["b"].dropped.total() == 3


def test_any_order_will_do(two):
    for t in range(20):
        from_a(two, notice(t=float(t)))
    np.random.default_rng(1).shuffle(two.sent)
    assert sorted(said.z.t for _, said in two.flush()["b"]) == list(range(20))
    assert not two.inboxes["b"].dropped


def test_what_is_lost_is_missed(two):
    for _ in range(10):
        from_a(two)
    del two.sent[2:5]
    two.flush()
    assert two.inboxes["b"].peers["a"].missing == 3
    for _ in range(2):
        from_a(two)
    two.sent.clear()  # the last ones, which leave no gap
    two.beat("a")
    two.flush()
    assert two.inboxes["b"].peers["a"].missing == 5


def test_what_was_missed_and_comes_late_is_not_missed(two):
    for _ in range(3):
        from_a(two)
    late = two.sent.pop(1)[0]
    two.flush()
    assert two.inboxes["b"].peers["a"].missing == 1
    assert two.deliver(late, "a", "b") is not None
    assert two.inboxes["b"].peers["a"].missing == 0


def test_older_than_all_memory_is_left_out(two):
    for _ in range(REMEMBERED + 2):
        from_a(two, Refusal("b", 1, 1, 1.0, "late"))
    first = two.sent.pop(0)[0]
    two.flush()
    two.inboxes["b"].dropped.clear()
    assert two.deliver(first, "a", "b") is None
    assert two.inboxes["b"].dropped == {"older than can be told from a duplicate": 1}


def test_one_forged_number_does_not_silence_a_robot(two):
    forged = Sent("a", two.session("a"), 2**64 - 1, two.clock("a"))
    for said in (Heartbeat(0.0, 0.0), notice()):
        two.deliver(encoded(forged, said), "a", "b")
    assert two.inboxes["b"].dropped == {"numbered far ahead of all others": 1}
    two.t += POLICY.silence + 5.0
    two.meet()
    assert [peer.name for peer in two.inboxes["b"].live(two.t)] == ["a"]
    from_a(two)
    (came,) = two.flush()["b"]
    assert came is not None


def test_a_forged_number_of_a_first_heartbeat_does_not_hold_a_robot_where_it_is():
    ether = Ether(a=0.0, b=0.0)
    forged = Sent("a", ether.session("a"), 2**64 - 1, ether.clock("a"))
    ether.deliver(encoded(forged, Heartbeat(0.0, 0.0)), "a", "b")
    ether.meet()
    ether.beat("a", until=9.0, position=8.0)
    ether.flush()
    peer = ether.inboxes["b"].peers["a"]
    assert (peer.position, peer.until) == (8.0, 9.0)
    assert ether.inboxes["b"].trusted(peer)


def test_who_starts_anew_is_another_session(two):
    from_a(two)
    old = two.sent.pop()[0]
    two.t += 30.0
    two.start("a")
    two.meet()
    peer = two.inboxes["b"].peers["a"]
    assert (peer.sessions, peer.session) == (2, two.session("a"))
    assert two.deliver(old, "a", "b") is None
    assert two.inboxes["b"].dropped == {"of an earlier session": 1}
    from_a(two)
    (came,) = two.flush()["b"]
    assert came is not None


def test_a_clock_that_is_set_back_before_a_start_locks_nobody_out(two):
    two.ahead["a"] = -500.0
    two.start("a")
    two.beat("a")
    two.flush()
    assert two.inboxes["b"].dropped == {"of an earlier session": 1}
    two.t += POLICY.silence + 0.1
    two.ahead["a"] = 0.1
    two.meet()
    from_a(two)
    (came,) = two.flush()["b"]
    assert came is not None


def test_a_reply_to_an_earlier_session_is_left_out(two):
    session = two.session("a")
    two.t += 30.0
    two.start("a")
    two.meet()
    two.outboxes["b"].to_one("a", two.session("a"), Reply("a", session, 0, 5.0, 1.0, RING))
    assert two.flush()["a"] == [None]
    assert two.inboxes["a"].dropped == {"about an earlier session": 1}


def test_what_a_robot_with_another_detection_model_tells_is_left_out(two):
    """Another map, or no fingerprint at all, is no reason."""
    inbox = two.inboxes["b"]
    inbox.common = Common(1, 2, 3)
    for common, differing, why in (
        (Common(1, 2, 3), [], ""),
        (Common(), [], ""),
        (Common(1, 9, 9), ["map", "landmarks"], ""),
        (Common(7, 2, 0), ["detection"], "of a robot with another detection model"),
        (Common(1, 2, 3), [], ""),
    ):
        two.inboxes["a"].common = common
        two.beat("a")
        from_a(two)
        came = two.flush()["b"]
        assert (came[-1] is None) == bool(why)
        assert inbox.differing(inbox.peers["a"]) == differing
        assert inbox.barred(inbox.peers["a"]) == why
    assert inbox.dropped == {"of a robot with another detection model": 1}


def test_who_is_silent_is_gone_and_comes_back(two):
    inbox = two.inboxes["b"]
    assert [p.name for p in inbox.live(two.t)] == ["a"]
    two.t += POLICY.silence + 0.1
    assert inbox.live(two.t) == []
    two.beat("a")
    two.flush()
    assert [p.name for p in inbox.live(two.t)] == ["a"]
    two.outboxes["a"].to_all(Farewell())
    two.flush()
    assert inbox.live(two.t) == []
    from_a(two)
    assert two.flush()["b"] == [None]
    assert inbox.dropped == {"after its farewell": 1}


@pytest.mark.parametrize(
    ("ahead", "why"),
    [
        (0.0, None),
        (0.4, None),
        (-0.4, None),
        (0.6, "of a clock too far ahead"),
        (-0.6, "of a clock too far behind"),
        (1e6, "of a clock too far ahead"),
        (-900.0, "of a clock too far behind"),
    ],
)
def test_clocks_that_are_too_far_apart(ahead, why):
    ether = Ether(a=ahead, b=0.0)
    ether.meet()
    from_a(ether)
    (came,) = ether.flush()["b"]
    assert (came is None) == (why is not None)
    assert ether.inboxes["b"].dropped == Counter([why] if why else [])
    assert ether.inboxes["b"].trusted(ether.inboxes["b"].peers["a"]) == (why is None)


def test_clocks_are_not_blamed_for_delays():
    """Messages that take 3 s do not prove that the clocks are apart."""
    ether = Ether(a=0.0, b=0.0)
    ether.meet(delay=3.0)
    from_a(ether)
    ether.t += 3.0
    (came,) = ether.flush()["b"]
    assert came is not None


def test_a_clock_is_compared_before_it_is_trusted():
    ether = Ether(a=0.0, b=0.0)
    from_a(ether)
    (data, *_) = ether.sent[0]
    assert ether.flush()["b"] == [None]
    assert ether.inboxes["b"].dropped == {"of a clock not compared yet": 1}
    ether.meet()
    assert ether.deliver(data, "a", "b") is not None  # when it is sent again


def test_a_clock_that_is_set_right_is_trusted_again():
    ether = Ether(a=10.0, b=0.0)
    ether.meet()
    ether.ahead["a"] = 0.0
    ether.meet()
    from_a(ether)
    (came,) = ether.flush()["b"]
    assert came is not None


def test_a_heartbeat_that_was_overtaken_takes_nothing_back(two):
    two.beat("a", until=7.0, position=6.0)
    two.beat("a", until=9.0, position=8.0)
    two.sent.reverse()
    two.flush()
    peer = two.inboxes["b"].peers["a"]
    assert (peer.position, peer.until) == (8.0, 9.0)


WRONG_SENDERS = {
    "under the name of another robot": ("a", 1, "c"),
    "of another robot of this name": ("b", 1, "b"),
    "of an earlier session": ("a", 1, "a"),
}


@pytest.mark.parametrize("why", WRONG_SENDERS)
def test_who_cannot_be_the_sender(two, why):
    name, session, key = WRONG_SENDERS[why]
    data = encoded(Sent(name, session, 1000, two.t), notice())
    assert two.deliver(data, key, "b") is None
    assert two.inboxes["b"].dropped == {why: 1}


def test_an_echo_is_no_news(two):
    data = encoded(Sent("b", two.session("b"), 1000, two.t), notice())
    assert two.deliver(data, "b", "b") is None
    assert not two.inboxes["b"].dropped


def test_what_is_for_another_robot_is_left_out(two):
    from_a(two, notice(seen="c"))
    assert two.flush()["b"] == [None]
    assert two.inboxes["b"].dropped == {"for another robot": 1}


def test_a_team_has_no_more_robots_than_it_may_have(two):
    inbox = two.inboxes["b"]
    for k in range(2 * MOST_HEARD):
        two.deliver(encoded(Sent(f"x{k}", 1, 0, two.t), Farewell()), f"x{k}", "b")
    assert len(inbox.peers) == MOST_HEARD
    assert "a" in inbox.peers  # those that have left make room
    for k in range(2 * MOST_HEARD):
        data = encoded(Sent(f"y{k}", 1, 0, two.t), Heartbeat(0.0, 0.0))
        two.deliver(data, f"y{k}", "b")
    assert len(inbox.peers) == MOST_HEARD
    assert inbox.dropped["of more robots than a team may have"] >= MOST_HEARD
    assert len(inbox.heard(two.t, two.outboxes["b"].told)) <= MOST_HEARD


def test_what_a_peer_says_to_have_sent_is_believed_within_bounds(two):
    liar = two.outboxes["a"]
    liar.told = lambda *_: 2**60
    two.beat("a")
    two.flush()
    assert two.inboxes["b"].peers["a"].missing <= 1024


SAYINGS = st.sampled_from(
    [
        notice(),
        Reply("b", 1, 1, 5.0, 1.0, RING),
        Refusal("b", 1, 1, 5.0, "late"),
        Farewell(),
        Heartbeat(1.0, 2.0),
    ]
)


@settings(max_examples=60)
@given(
    st.lists(
        st.tuples(
            st.one_of(
                st.binary(max_size=80),
                st.builds(
                    encoded,
                    st.builds(
                        Sent,
                        st.sampled_from(["a", "b", "c"]),
                        st.integers(0, 2**64 - 1) | st.just(int(BEGAN * 1e9)),
                        st.integers(0, 2**64 - 1) | st.integers(0, 5),
                        st.floats(0.0, 1e11) | st.just(BEGAN),
                    ),
                    SAYINGS,
                ),
            ),
            st.sampled_from(["a", "b", "c"]),
        ),
        max_size=30,
    )
)
def test_whatever_comes_it_is_used_or_counted(coming):
    """Nothing raises; each message is used, an echo, a sign of life, or counted once."""
    ether = Ether(a=0.0, b=0.0)
    inbox = ether.inboxes["b"]
    for data, sender in coming:
        before = inbox.dropped.total()
        used = ether.deliver(data, sender, "b") is not None
        assert inbox.dropped.total() - before <= (0 if used else 1)
    for peer in inbox.peers.values():
        assert peer.missing >= 0
    assert set(map(type, inbox.dropped)) <= {str}
    assert all(len(why) < 60 for why in inbox.dropped)
