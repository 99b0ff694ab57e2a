"""Other robots that a robot saw, recorded beside its log.

    t,seen,range,bearing,heading
    1248273664.25,r2,3.1,-0.4,

t: s, by the clock of the log. seen: the name of the other robot. range: m, to its middle. bearing,
heading: rad, where it is and where it faces, from the heading of the one that sees it, positive to
the left; either column may be left out, and a field that is empty was not measured.
"""

import math
from collections.abc import Iterable, Iterator
from itertools import chain, islice, tee
from pathlib import Path

from mcloc.errors import LogError
from mcloc.events import Detection, Event
from mcloc.localizer.leap_guard import believed
from mcloc.textfile import TextFile

NEEDED = "t", "seen", "range"


def read_detections(path: str | Path) -> list[Detection]:
    """Those in a CSV file, see above, in the order of time. Raises LogError for a file that is
    missing or empty, and, with its line, for a row that cannot be.
    """
    text, found = TextFile(str(path), LogError), []
    for line, row in text.records(NEEDED):
        t, r = (text.number(line, name, row[name]) for name in ("t", "range"))
        bearing, heading = (
            text.number(line, name, row[name]) if row.get(name) else math.nan
            for name in ("bearing", "heading")
        )
        if r <= 0.0:
            raise text.fault(line, f"range must be > 0 m, got {r:g}")
        if not row["seen"]:
            raise text.fault(line, "which robot was seen? Its name is missing")
        found.append(Detection(t, row["seen"], r, bearing, heading))
    return sorted(found, key=lambda z: z.t)


def among(events: Iterable[Event], detections: Iterable[Detection]) -> Iterator[Event | Detection]:
    """The events of a log with the detections in their places: before the first event that is not
    earlier. One wrong stamp in the log does not bring them before their time.
    """
    following = iter(detections)
    z = next(following, None)
    events, later = tee(events)
    stamps = chain((event.t for event in islice(later, 1, None)), [math.inf])
    for event, after in zip(events, stamps, strict=True):
        while z is not None and z.t <= believed(event.t, after):
            yield z
            z = next(following, None)
        yield event
    while z is not None:
        yield z
        z = next(following, None)
