"""Letters: who may answer, and what is bounded."""

import math

import pytest
from tests.team.conftest import ring
from tests.team.hub import Hub

from mcloc.events import Detection
from mcloc.team.letters import Notice, Refusal, Reply
from mcloc.team.peer_policy import PeerPolicy
from mcloc.team.post import MOST_ANSWERS, MOST_NOTICES, Post

POLICY = PeerPolicy(reply_wait=0.5, again=60.0, silence=60.0)
RING = ring(100)


@pytest.fixture
def posts():
    """Three robots that know each other's clocks."""
    hub = Hub()
    posts = [Post(name, hub.carrier(name), POLICY) for name in "123"]
    for _ in range(2):
        for post in posts:
            post.beat()
            for other in posts:
                other.serve()
    return posts


def notice(seen="2", t=5.0):
    return Notice(Detection(t, seen, 3.0, 0.4), -math.inf, math.inf, RING)


def test_the_one_that_was_asked_answers(posts):
    one, two, _ = posts

    def meanwhile():
        two.serve()
        while two.due:
            due = two.due.pop()
            number = due.sent.number
            two.answer(due.sent, Reply("1", due.sent.session, number, due.t, 1.0, RING))

    answer = one.ask(one.inbox.peers["2"], notice(), meanwhile)
    assert isinstance(answer, Reply)
    assert one.sizes[0] == pytest.approx(two.sizes[0], abs=100)
    assert not one.dropped + two.dropped


def test_nobody_else_answers(posts):
    """Robot 3 forges the number of the notice, but not who it is."""
    one, _, three = posts
    session = one.inbox.session

    def meanwhile():
        to = type("To", (), {"sender": "1", "session": session, "number": 0})
        three.answer(to, Reply("1", session, 0, 5.0, 1.0, RING))

    assert one.ask(one.inbox.peers["2"], notice(), meanwhile) is None
    assert set(one.dropped) == {"answer that came too late"}


def test_notices_that_wait_are_bounded(posts):
    one, two, _ = posts
    peer = one.inbox.peers["2"]
    for k in range(MOST_NOTICES + 5):
        one._outbox.to_one("2", peer.session, notice(t=100.0 - k))
    two.serve()
    assert len(two.due) == MOST_NOTICES
    assert two.dropped == {"too many notices at once": 5}
    assert [due.t for due in two.due] == sorted(due.t for due in two.due)


def test_answers_that_are_remembered_are_bounded(posts):
    one, two, _ = posts
    for number in range(MOST_ANSWERS + 5):
        to = type("To", (), {"sender": "1", "session": one.inbox.session, "number": number})
        two.answer(to, Refusal("1", one.inbox.session, number, 5.0, "late"))
    assert len(two._answers) == MOST_ANSWERS
