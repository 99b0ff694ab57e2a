"""Zenoh carries bytes between peers on loopback; ports are the system's choice."""

import sys
import time

import pytest

from mcloc.errors import ConfigError, MessageError
from mcloc.team.peer_policy import PeerPolicy
from mcloc.team.peers import Peers
from mcloc.team.post import Post
from mcloc.team.wire import MOST_BYTES

LONG = 30.0  # s, for a machine that is busy


@pytest.fixture
def started():
    """Starts peers, and closes them."""
    peers = []

    def start(name, *others, **options):
        ends = [end for other in others for end in other.listening]
        peers.append(Peers(name, connect=ends, **options))
        return peers[-1]

    yield start
    for peer in peers:
        peer.close()


def until(condition):
    end = time.monotonic() + LONG
    while not condition():
        assert time.monotonic() < end, "nothing came in time"
        time.sleep(0.01)


def collected(peer, found):
    """What has come so far, after a message to all that is sent until one comes."""
    found += [(a.sender, a.data) for a in peer.arrived()]
    return found


def meet(*peers):
    """Until each has heard all others."""
    heard = {id(p): [] for p in peers}

    def met():
        for p in peers:
            p.send(b"hello", None)
            collected(p, heard[id(p)])
        return all(len({s for s, _ in heard[id(p)]}) == len(peers) - 1 for p in peers)

    until(met)
    time.sleep(0.2)
    for p in peers:
        p.arrived()


def test_all_hear_what_is_for_all_and_one_what_is_for_one(started):
    a = started("a")
    b, c = started("b", a), started("räuber", a)  # b and räuber find each other by a
    meet(a, b, c)
    b.send(b"to all", None)
    b.send(b"to one", "räuber")
    found_a, found_c = [], []
    until(lambda: len(collected(c, found_c)) == 2 and collected(a, found_a))
    assert sorted(found_c) == [("b", b"to all"), ("b", b"to one")]
    assert found_a == [("b", b"to all")]
    assert b.arrived() == []


def test_a_peer_may_come_before_the_one_that_it_connects_to(started):
    later = started("a")
    (end,) = later.listening
    later.close()
    early = started("b", later)
    meet(started("a", listen=[end]), early)


def test_teams_do_not_hear_each_other(started):
    a = started("a")
    b, stranger = started("b", a), started("c", a, team="others")
    meet(a, b)
    stranger.send(b"hello", None)
    b.send(b"last", None)
    found = []
    until(lambda: collected(a, found))
    assert found == [("b", b"last")]


def test_what_nobody_asks_for_is_bounded_and_counted(started, monkeypatch):
    monkeypatch.setattr("mcloc.team.peers.MOST_WAITING", 10)
    a = started("a")
    b = started("b", a)
    meet(a, b)

    def flooded():
        b.send(b"x", "a")
        return a.dropped() > 5

    until(flooded)
    assert len(a.arrived()) == 10


def test_what_is_too_long_is_cut(started):
    a = started("a")
    b = started("b", a)
    meet(a, b)
    b.send(bytes(20 * MOST_BYTES), "a")  # more than Zenoh takes in, or less
    b.send(bytes(4 * MOST_BYTES), "a")
    found = []
    until(lambda: collected(a, found))
    assert {len(data) for _, data in found} == {MOST_BYTES + 1}


def test_another_robot_of_the_same_name_is_counted(started):
    one = started("r")
    two = started("r", one)
    posts = [Post("r", peers, PeerPolicy()) for peers in (one, two)]

    def noticed():
        for post in posts:
            post.beat()
            post.serve()
        return all(post.dropped["of another robot of this name"] for post in posts)

    until(noticed)
    for post in posts:
        assert set(post.dropped) == {"of another robot of this name"}
        assert post.live() == []


@pytest.mark.parametrize(
    "endpoint", ["rubbish", "tcp/nohost", "tcp/300.1.1.1:0", "nay/127.0.0.1:1"]
)
def test_endpoints_that_cannot_be(endpoint):
    with pytest.raises(ConfigError) as error:
        Peers("a", listen=[endpoint])
    assert endpoint in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_a_port_that_is_taken(started):
    a = started("a")
    with pytest.raises(ConfigError, match="taken"):
        Peers("b", listen=a.listening)


def test_names_that_cannot_be():
    for name in ("", "a/b", "a*", "n" * 33):
        with pytest.raises(MessageError):
            Peers(name)
        with pytest.raises(MessageError):
            Peers("a", name)


def test_without_zenoh_the_remedy_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "zenoh", None)
    with pytest.raises(ConfigError, match=r"pip install 'mcloc\[team\]'"):
        Peers("a")
