"""What robots of a team tell each other."""

from dataclasses import dataclass, fields

from mcloc.density_tree import DensityTree
from mcloc.errors import MessageError
from mcloc.events import Detection

MOST_NAME = 32  # bytes of a robot's name
MOST_HEARD = 64  # peers that a heartbeat tells of

_RESERVED = frozenset("/*$?#")  # in the names of keys


@dataclass(frozen=True, slots=True)
class Sent:
    """Who sends a message. sender: the robot's name. session: ns, when its process began, by its
    clock. number: of the message, 0, 1, …: those to all robots are numbered by themselves, and so
    are those to each single one. clock: s, the sender's, when it sends.
    """

    sender: str
    session: int
    number: int
    clock: float


@dataclass(frozen=True, slots=True)
class Heard:
    """The last heartbeat that came from a peer. session: of that peer. clock: s, what it said its
    clock was. since: s that have passed here since it came. told: messages to it alone, in that
    session of it.
    """

    peer: str
    session: int
    clock: float
    since: float
    told: int


@dataclass(frozen=True, slots=True)
class Common:
    """Fingerprints of what robots of a team should have in common, 0 for what one has not:
    detection, of the model of how they see each other; map and landmarks, of those it uses.
    """

    detection: int = 0
    map: int = 0
    landmarks: int = 0

    def differing(self, other: "Common") -> list[str]:
        """What both have, and not the same."""
        both = {f.name: (getattr(self, f.name), getattr(other, f.name)) for f in fields(self)}
        return [name for name, (a, b) in both.items() if a and b and a != b]


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """A robot is there. position: s, the last stamp that it has processed, −inf before the first.
    until: s, the stamp before which it will not tell of another sighting; NaN while it still waits
    for others. heard: of whom it hears, for them to compare clocks by. common: what it should have
    in common with others.
    """

    position: float
    until: float
    heard: tuple[Heard, ...] = ()
    common: Common = Common()


@dataclass(frozen=True, slots=True)
class Farewell:
    """A robot leaves."""


@dataclass(frozen=True, eq=False)
class Notice:
    """The sender saw a robot: z, of which `seen` names that one. last: s, the stamp of the last
    sighting of the two that was used, −∞ if none was. moved: m, how far the sender has come since;
    ∞ if none was. tree: where the seen one is by the sender's belief, x, y or x, y, θ; None where
    it has no place itself.
    """

    z: Detection
    last: float
    moved: float
    tree: DensityTree | None


@dataclass(frozen=True, eq=False)
class Reply:
    """Where the robot is that sent a notice, by the belief of the one that it saw. seer: its name.
    session, number: of the notice. t: s, of the sighting. moved: m, how far the farther one of the
    two has come since the last one that was used. tree: over x, y, θ, or x, y; None where it has no
    place itself.
    """

    seer: str
    session: int
    number: int
    t: float
    moved: float
    tree: DensityTree | None


@dataclass(frozen=True, slots=True)
class Refusal:
    """That a notice was not used. why: one of WHY. The others as of a Reply."""

    seer: str
    session: int
    number: int
    t: float
    why: str


WHY = (
    "late",
    "of the same robots again",
    "without odometry",
    "between robots that have no place yet",
)


Said = Heartbeat | Farewell | Notice | Reply | Refusal


def check_name(name: str) -> str:
    """The name, if a robot can have it: 1 to 32 bytes that can be printed, without space or any of
    / * $ ? #. Raises MessageError otherwise.
    """
    if not 0 < len(name.encode(errors="replace")) <= MOST_NAME:
        raise MessageError("name too long, or empty")
    if not name.isprintable() or " " in name or _RESERVED & set(name):
        raise MessageError("name with characters that it may not have")
    return name
