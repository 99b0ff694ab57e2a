"""Logs of one message a line: a word that says what it is, then its fields; `#` is a comment."""

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from mcloc.events import Event
from mcloc.geometry import Pose, between
from mcloc.textfile import TextFile

Fields = list[str]
Parser = Callable[[Fields], Event | None]
Skipped = Counter[str]

_MESSAGE = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")


@dataclass(frozen=True)
class Format:
    """One kind of log.

    name: for messages to the user. recognizes: whether the words of one line are this format's.
    events: its events in the order of the file, counting in Skipped what is left out; values that
    are not finite are passed on, what is done about them is the same for all formats.
    """

    name: str
    recognizes: Callable[[Fields], bool]
    events: Callable[[TextFile, Skipped], Iterator[Event]]


def events(text: TextFile, parsers: Mapping[str, Parser], skipped: Skipped) -> Iterator[Event]:
    """What the parsers, by first word, make of each line's other fields.

    A parser raises ValueError or IndexError for fields that are wrong or missing: here they get
    their path and line. Messages without a parser are counted, lines that are no message raise.
    """
    for number, line in text.lines():
        word, *fields = line.split() or ["#"]
        if word.startswith("#"):
            continue
        parser = parsers.get(word)
        if parser is None:
            if not _MESSAGE.fullmatch(word):
                raise text.fault(number, f"{word[:20]!r} begins no message; damaged here?")
            skipped[f"message {word}"] += 1
            continue
        try:
            event = parser(fields)
        except ValueError as cause:
            raise text.fault(number, f"{word}: {cause}") from cause
        except IndexError as cause:
            raise text.fault(number, f"{word}: the line is cut") from cause
        if event is not None:
            yield event


def expect(fields: Fields, n: int) -> None:
    """Raise ValueError unless there are n fields."""
    if len(fields) != n:
        raise ValueError(
            f"{n} fields expected after the word, {len(fields)} found; the line is cut or damaged"
        )


def count(field: str) -> int:
    """A number of readings."""
    n = int(field)
    if n < 0:
        raise ValueError(f"the number of readings cannot be {n}")
    return n


def floats(fields: Fields) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """(n,): the fields as numbers, NaN and inf included."""
    return np.array([float(field) for field in fields], dtype=np.float64)


def mount_of(laser: Pose, robot: Pose) -> Pose:
    """⊖robot ⊕ laser: the laser's pose in the robot's frame, NaN where either is not finite."""
    with np.errstate(all="ignore"):
        return between(robot, laser)
