"""What robots of a team tell each other, as bytes: data only, of a version, a length and a checksum
that have to be right. Little-endian,

    magic 4, version 1, kind 1, length 4 (of everything), CRC-32 4 (of all that follows)
    sender (its length 1, then UTF-8), session 8, number 8, clock 8
    and what a message of this kind says

What they say is in `letters`; the density tree of a notice or a reply is of a bounded size, see
`packed_tree`.
"""

import math
import struct
import zlib
from collections.abc import Callable
from dataclasses import astuple

import numpy as np

from mcloc.density import FAR
from mcloc.density_tree import DensityTree
from mcloc.errors import MessageError
from mcloc.events import Detection
from mcloc.statespace import PLANE, SE2
from mcloc.team.letters import (
    MOST_HEARD,
    MOST_NAME,
    WHY,
    Common,
    Farewell,
    Heard,
    Heartbeat,
    Notice,
    Refusal,
    Reply,
    Said,
    Sent,
    check_name,
)
from mcloc.team.packed_tree import MOST_LEAVES, most_bytes, packed, unpacked
from mcloc.team.reader import Reader

VERSION = 2
MAGIC = b"mcTM"

_FRAME = struct.Struct("<4sBBII")
_SENT = struct.Struct("<QQd")
_HEARD = struct.Struct("<QddQ")
_SEEN = struct.Struct("<d3d3d2d")
_ANSWER = struct.Struct("<QQd")
_BEAT = struct.Struct("<dd3QB")
_MOVED = struct.Struct("<d")
_WHY = struct.Struct("<B")
_LATEST = 1e12  # s, stamps and clocks
_TURN = math.pi + 1e-6  # rad
_LARGEST_ROBOT = 1e3  # m

MOST_BYTES = (
    _FRAME.size
    + 1
    + MOST_NAME
    + _SENT.size
    + max(
        1
        + MOST_NAME
        + max(_SEEN.size, _ANSWER.size + _MOVED.size)
        + most_bytes(SE2.dimension, MOST_LEAVES),
        _BEAT.size + MOST_HEARD * (1 + MOST_NAME + _HEARD.size),
    )
)
"""No message is longer."""


_KINDS: dict[int, type[Said]] = {1: Heartbeat, 2: Farewell, 3: Notice, 4: Reply, 5: Refusal}
_CODES = {kind: code for code, kind in _KINDS.items()}


def encoded(sent: Sent, said: Said) -> bytes:
    """The message, at most MOST_BYTES long."""
    body = _name(sent.sender) + _SENT.pack(sent.session, sent.number, sent.clock)
    match said:
        case Heartbeat(position, until, heard, common):
            body += _BEAT.pack(position, until, *astuple(common), len(heard))
            for h in heard:
                body += _name(h.peer) + _HEARD.pack(h.session, h.clock, h.since, h.told)
        case Notice(z, last, moved, tree):
            bearing, heading = (math.remainder(a, math.tau) for a in (z.bearing, z.heading))
            measured = z.t, z.range, bearing, heading, *z.mount, last, moved
            body += _name(z.seen) + _SEEN.pack(*measured) + _packed(tree)
        case Reply():
            body += _name(said.seer) + _ANSWER.pack(said.session, said.number, said.t)
            body += _MOVED.pack(said.moved) + _packed(said.tree)
        case Refusal():
            body += _name(said.seer) + _ANSWER.pack(said.session, said.number, said.t)
            body += bytes([WHY.index(said.why)])
    code = _CODES[type(said)]
    return _FRAME.pack(MAGIC, VERSION, code, _FRAME.size + len(body), _checksum(code, body)) + body


class Envelope:
    """A message whose frame and checksum are right, of which no more is read than who sent it.
    kind: of what it says.
    """

    def __init__(self, kind: type[Said], read: Reader) -> None:
        self.kind, self._read = kind, read
        self.sent = Sent(read.name(), *read.values(_SENT))
        _check_times(self.sent.clock)

    def said(self) -> Said:
        """What it says, to be asked for once; a tree takes a millisecond. Raises MessageError."""
        said = _SAYING[self.kind](self._read)
        self._read.end()
        return said


def opened(data: bytes) -> Envelope:
    """The message that the bytes are. Raises MessageError, and nothing else, for what is none: the
    few words of it name why.
    """
    if len(data) > MOST_BYTES:
        raise MessageError("too long")
    if len(data) < _FRAME.size:
        raise MessageError("too short")
    magic, version, code, length, checksum = _FRAME.unpack_from(data)
    if magic != MAGIC:
        raise MessageError("no message of mcloc")
    if version != VERSION:
        raise MessageError("of another version")
    if length != len(data):
        raise MessageError("of another length than it says")
    if code not in _KINDS:
        raise MessageError("of an unknown kind")
    if checksum != _checksum(code, data[_FRAME.size :]):
        raise MessageError("damaged")
    return Envelope(_KINDS[code], Reader(data, _FRAME.size))


def decoded(data: bytes) -> tuple[Sent, Said]:
    """Who sent the bytes, and what they say. Raises MessageError as above."""
    envelope = opened(data)
    return envelope.sent, envelope.said()


def _packed(tree: DensityTree | None) -> bytes:
    return b"" if tree is None else packed(tree)


def _unpacked(data: bytes) -> DensityTree | None:
    return unpacked(data, PLANE, SE2) if data else None


def _name(name: str) -> bytes:
    text = check_name(name).encode()
    return bytes([len(text)]) + text


def _checksum(code: int, body: bytes) -> int:
    return zlib.crc32(body, zlib.crc32(bytes([VERSION, code])))


def _check_times(*times: float) -> None:
    if not all(abs(t) < _LATEST for t in times):  # NaN is not
        raise MessageError("stamp that cannot be")


def _heartbeat(read: Reader) -> Heartbeat:
    position, until, *common, n = read.values(_BEAT)
    if n > MOST_HEARD:
        raise MessageError("too many peers")
    if position != -math.inf:
        _check_times(position)
    if math.isfinite(until):
        _check_times(until)
    heard = []
    for _ in range(n):
        peer, (session, clock, since, told) = read.name(), read.values(_HEARD)
        _check_times(clock, since)
        heard.append(Heard(peer, session, clock, since, told))
    return Heartbeat(position, until, tuple(heard), Common(*common))


def _notice(read: Reader) -> Notice:
    seen, (t, distance, bearing, heading, *mount, last, moved) = read.name(), read.values(_SEEN)
    _check_times(t)
    if not 0.0 < distance < FAR:
        raise MessageError("range that cannot be")
    if abs(bearing) > _TURN or abs(heading) > _TURN:  # either may be NaN
        raise MessageError("angle that cannot be")
    if not all(abs(m) < _LARGEST_ROBOT for m in mount):
        raise MessageError("mount that cannot be")
    if math.isnan(last):
        raise MessageError("stamp that cannot be")
    z = Detection(t, seen, distance, bearing, heading, np.array(mount))
    return Notice(z, last, _distance(moved), _unpacked(read.rest()))


def _reply(read: Reader) -> Reply:
    answer, (moved,) = _answer(read), read.values(_MOVED)
    return Reply(*answer, _distance(moved), _unpacked(read.rest()))


def _refusal(read: Reader) -> Refusal:
    answer, (why,) = _answer(read), read.values(_WHY)
    if why >= len(WHY):
        raise MessageError("refused for no known reason")
    return Refusal(*answer, WHY[why])


def _distance(moved: float) -> float:
    if not moved >= 0.0:
        raise MessageError("distance that cannot be")
    return moved


def _answer(read: Reader) -> tuple[str, int, int, float]:
    seer, (session, number, t) = read.name(), read.values(_ANSWER)
    _check_times(t)
    return seer, session, number, t


def _farewell(_: Reader) -> Farewell:
    return Farewell()


_SAYING: dict[type[Said], Callable[[Reader], Said]] = {
    Heartbeat: _heartbeat,
    Farewell: _farewell,
    Notice: _notice,
    Reply: _reply,
    Refusal: _refusal,
}
