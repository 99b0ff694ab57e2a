"""Messages: what is said comes back; whatever the bytes, they are a message or a few words say why
not.
"""

import math
import struct
import tracemalloc
import zlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.team.conftest import place, ring

from mcloc.density_tree import DensityTree
from mcloc.errors import MessageError
from mcloc.events import Detection
from mcloc.particles import Particles
from mcloc.statespace import LINE, PLANE, SE2
from mcloc.team import letters, wire
from mcloc.team.compression import compressed
from mcloc.team.letters import Common, Farewell, Heard, Heartbeat, Notice, Refusal, Reply, Sent
from mcloc.team.packed_tree import MOST_LEAVES, most_bytes, packed, unpacked
from mcloc.team.wire import decoded, encoded

SENT = Sent("räuber-1", 7, 42, 1.7e9)
Z = Detection(12.5, "r2", 3.25, -0.4, mount=np.array([0.25, 0.0, 0.5]))
NOTICE = Notice(Z, -math.inf, 1.5, place(200))
REPLY = Reply("r2", 2**64 - 1, 2**64 - 1, 12.5, 2.5, ring(200))
BEAT = Heartbeat(12.0, 13.0, (Heard("r2", 3, 5.0, 0.25, 9), Heard("r3", 4, 6.0, 0.5, 0)), Common(7))
REFUSAL = Refusal("r2", 3, 4, 12.5, "late")
SAYINGS = [BEAT, Heartbeat(12.0, float("inf")), Farewell(), NOTICE, REPLY, REFUSAL]
MESSAGES = [encoded(SENT, said) for said in SAYINGS]
FRAME = 14  # bytes before what the checksum is of


def sealed(message):
    """With the length and the checksum that it should have: only what is behind them is wrong."""
    checksum = zlib.crc32(message[FRAME:], zlib.crc32(message[4:6]))
    return message[:6] + struct.pack("<II", len(message), checksum) + message[FRAME:]


def refusal(data):
    """Why it is no message, or nothing."""
    try:
        decoded(data)
    except MessageError as error:
        said = str(error)
        assert 0 < len(said) < 60
        return said
    return ""


def same_tree(a, b):
    assert a.space == b.space
    x = a.low[:, None] + a.side[:, None] * np.random.default_rng(1).random((len(a.low), 2000))
    assert b.log_density(x) == pytest.approx(a.log_density(x), abs=1e-5)
    assert b.mass.sum() == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("said", [BEAT, Heartbeat(-math.inf, math.inf), Farewell(), REFUSAL])
def test_what_is_said_comes_back(said):
    assert decoded(encoded(SENT, said)) == (SENT, said)


def test_a_notice_and_a_reply_come_back_with_their_trees():
    sent, notice = decoded(encoded(SENT, NOTICE))
    assert sent == SENT
    z = notice.z
    assert (z.t, z.seen, z.range, z.bearing) == (12.5, "r2", 3.25, -0.4)
    assert (notice.last, notice.moved) == (-math.inf, 1.5)
    assert np.isnan(z.heading)
    assert z.mount.tolist() == [0.25, 0.0, 0.5]
    same_tree(NOTICE.tree, notice.tree)
    _, reply = decoded(encoded(SENT, REPLY))
    assert (reply.seer, reply.session, reply.number) == ("r2", *2 * (2**64 - 1,))
    assert (reply.t, reply.moved) == (12.5, 2.5)
    same_tree(REPLY.tree, reply.tree)


@pytest.mark.parametrize("turns", [-1, 1, 5])
def test_angles_of_another_convention_come_back_wrapped(turns):
    more = 2.0 * np.pi * turns
    _, told = decoded(encoded(SENT, notice(bearing=-0.4 + more, heading=3.0 + more)))
    assert told.z.bearing == pytest.approx(-0.4)
    assert told.z.heading == pytest.approx(3.0)


def test_a_tree_comes_back(tree):
    same_tree(tree, unpacked(packed(tree), tree.space))
    small = compressed(tree, 20)
    same_tree(small, unpacked(packed(tree, 20), tree.space))
    assert len(packed(tree, 20)) == most_bytes(tree.space.dimension, 20)


def test_a_single_particle_comes_back():
    tree = DensityTree.fit(Particles.equal(np.zeros((2, 1))), PLANE)
    same_tree(tree, unpacked(packed(tree), PLANE))


def test_no_message_is_longer_than_it_may_be():
    name = "n" * letters.MOST_NAME
    large = ring(20_000)
    assert len(large.child) > 2 * MOST_LEAVES
    heard = tuple(Heard(name, 1, 2.0, 3.0, 4) for _ in range(letters.MOST_HEARD))
    sizes = [
        len(encoded(Sent(name, 1, 2, 3.0), said))
        for said in (Reply(name, 1, 2, 3.0, 4.0, large), Heartbeat(0.0, 0.0, heard))
    ]
    assert max(sizes) <= wire.MOST_BYTES < 4500
    assert all(refusal(b"x" * n) for n in (wire.MOST_BYTES, wire.MOST_BYTES + 1, 100_000))


def with_name(name):
    message = encoded(SENT, Farewell())
    return sealed(message[:FRAME] + bytes([len(name)]) + name + message[FRAME + 10 :])


TREE_AT = len(MESSAGES[3]) - len(packed(NOTICE.tree))
LEAVES = (len(NOTICE.tree.child) + 1) // 2


def notice(last=1.0, moved=0.0, **changed):
    return Notice(replace(Z, **changed), last, moved, NOTICE.tree)


def with_tree(change):
    data = bytearray(packed(NOTICE.tree))
    change(data)
    return sealed(MESSAGES[3][:TREE_AT] + bytes(data))


def put(at, form, *values):
    return lambda data: struct.pack_into(form, data, at, *values)


def masses(*values):
    return put(43 + 2 * LEAVES - 1, f"<{len(values)}f", *values)


def cut(data):
    del data[-4:]


def deep(data):
    """A chain that halves one axis again and again."""
    n = 60
    data[:] = data[:1] + struct.pack("<H", n) + data[3:43]
    data += bytes([0, wire_leaf] * (n - 1) + [wire_leaf]) + np.full(n, 1 / n, "<f4").tobytes()


def with_bearing(bearing):
    """As no robot sends it."""
    data = bytearray(MESSAGES[3])
    at = data.index(struct.pack("<d", Z.bearing))
    struct.pack_into("<d", data, at, bearing)
    return sealed(bytes(data))


wire_leaf = 255


def heartbeat(position, until):
    return encoded(SENT, Heartbeat(position, until))


WRONG = {
    "too short": MESSAGES[0][:13],
    "too long": MESSAGES[0] + bytes(5000),
    "no message of mcloc": b"HTTP" + MESSAGES[0][4:],
    "of another version": sealed(MESSAGES[0][:4] + b"\x01" + MESSAGES[0][5:]),
    "of another length than it says": MESSAGES[0][:-1],
    "of an unknown kind": sealed(MESSAGES[0][:5] + b"\x09" + MESSAGES[0][6:]),
    "damaged": MESSAGES[0][:-1] + bytes([MESSAGES[0][-1] ^ 1]),
    "with less in it than belongs there": sealed(MESSAGES[0][:-1]),
    "with more in it than belongs there": sealed(MESSAGES[2] + b"\0"),
    "name too long, or empty": with_name(b"n" * 33),
    "name that is not UTF-8": with_name(b"\xff\xfe"),
    "name with characters that it may not have": with_name(b"a/**"),
    "stamp that cannot be": encoded(Sent("r1", 1, 1, float("nan")), Farewell()),
    "too many peers": sealed(MESSAGES[0][: FRAME + 74] + b"\xff" + MESSAGES[0][FRAME + 75 :]),
    "range that cannot be": encoded(SENT, notice(range=-1.0)),
    "angle that cannot be": with_bearing(4.0),
    "tree of the wrong length": with_tree(cut),
    "tree of another space": with_tree(put(0, "<B", 3)),
    "tree of too many leaves, or none": with_tree(put(1, "<H", 65535)),
    "distance that cannot be": encoded(SENT, notice(moved=np.nan)),
    "mount that cannot be": encoded(SENT, notice(mount=np.array([0.0, np.inf, 0.0]))),
    "refused for no known reason": sealed(MESSAGES[5][:-1] + b"\x09"),
    "floor of a tree not in [0, 1)": with_tree(put(3, "<d", 1.0)),
    "mass of a leaf NaN, infinite or negative": with_tree(masses(np.nan)),
    "masses of a tree that do not sum to 1": with_tree(masses(0.9)),
    "box of a tree that cannot be": with_tree(put(19, "<d", np.inf)),
    "box of a tree halved too often": with_tree(deep),
    "axis that is none": with_tree(put(43, "<B", 2)),
    "tree that is not whole": with_tree(put(43, "<B", wire_leaf)),
}


@pytest.mark.parametrize(
    ("position", "until"),
    [(math.inf, math.inf), (math.nan, 0.0), (1e300, 0.0), (-1e300, 0.0), (0.0, 1e300)],
)
def test_a_time_that_no_robot_can_be_at_is_refused(position, until):
    assert refusal(heartbeat(position, until)) == "stamp that cannot be"


@pytest.mark.parametrize("until", [-math.inf, math.nan, math.inf, 5.0])
def test_where_a_robot_is_before_its_first_event_comes_back(until):
    _, told = decoded(heartbeat(-math.inf, until))
    assert told.position == -math.inf
    assert repr(told.until) == repr(until)


@pytest.mark.parametrize("why", WRONG)
def test_what_is_wrong_is_named(why):
    assert refusal(WRONG[why]) == why


@pytest.mark.parametrize(
    "change",
    [
        masses(np.inf),
        masses(-1e-30),
        put(3, "<d", np.nan),
        put(3, "<d", -0.1),
        put(1, "<H", 0),
        put(1, "<H", LEAVES - 1),
        put(11, "<d", 1e12),
        put(11, "<d", np.nan),
        put(19, "<d", 0.0),
        put(19, "<d", -1.0),
        put(0, "<B", 0),
        put(43 + 2 * LEAVES - 2, "<B", 0),
    ],
)
def test_a_tree_that_cannot_be_is_refused(change):
    assert refusal(with_tree(change)) in WRONG


def test_the_circle_of_a_heading_is_whole():
    data = bytearray(packed(REPLY.tree))
    struct.pack_into("<d", data, 51, 6.0)
    with pytest.raises(MessageError, match="box of a tree that cannot be"):
        unpacked(bytes(data), SE2)


def test_the_whole_circle_survives_its_last_digit():
    data = bytearray(packed(REPLY.tree))
    struct.pack_into("<d", data, 51, 2.0 * np.pi + 1e-12)
    assert unpacked(bytes(data), SE2).side[2] == 2.0 * np.pi


def test_a_density_of_another_space_has_no_message():
    line = DensityTree.fit(Particles.equal(np.random.default_rng(1).normal(size=(1, 50))), LINE)
    with pytest.raises(MessageError, match="density over x"):
        packed(line)


@given(st.binary(max_size=5000))
@example(b"")
def test_random_bytes_are_refused(data):
    assert refusal(data)


@given(st.binary(max_size=400), st.integers(1, 5))
def test_random_bytes_that_look_right_from_outside_are_judged(data, kind):
    refusal(sealed(b"mcTM" + bytes([wire.VERSION, kind]) + bytes(8) + data))


@given(st.sampled_from(range(len(MESSAGES))).map(MESSAGES.__getitem__), st.data())
def test_a_message_that_is_cut_is_refused(message, data):
    n = data.draw(st.integers(0, len(message) - 1))
    assert refusal(message[:n])
    if n >= FRAME:
        refusal(sealed(message[:n]))


@given(st.sampled_from(range(len(MESSAGES))).map(MESSAGES.__getitem__), st.data())
def test_a_message_with_a_flipped_bit_is_refused(message, data):
    bit = data.draw(st.integers(0, 8 * len(message) - 1))
    flipped = bytearray(message)
    flipped[bit // 8] ^= 1 << bit % 8
    assert refusal(bytes(flipped))


@settings(max_examples=500)
@given(st.sampled_from(range(len(MESSAGES))).map(MESSAGES.__getitem__), st.data())
def test_damage_behind_a_right_checksum_is_judged(message, data):
    """It is refused, or still a message whose tree is a density."""
    changed = bytearray(message)
    for _ in range(data.draw(st.integers(1, 5))):
        changed[data.draw(st.integers(FRAME, len(message) - 1))] = data.draw(st.integers(0, 255))
    try:
        _, said = decoded(sealed(bytes(changed)))
    except MessageError:
        return
    if isinstance(said, Notice | Reply):
        tree = said.tree
        assert tree.mass.sum() == pytest.approx(1.0, rel=1e-9)
        assert not np.isnan(tree.log_values).any()
        middle = tree.low + 0.5 * tree.side
        assert not np.isnan(tree.log_density(middle[:, None])).any()


def test_nothing_that_comes_takes_much_memory():
    """A message that says to be large is refused before anything is made for it."""
    coming = [*WRONG.values(), b"mcTM" + bytes(10_000_000)]
    decoded(encoded(SENT, REPLY))
    tracemalloc.start()
    for data in coming:
        refusal(data)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 1_000_000
