"""Rows of numbers whose first one is a stamp, without those that are out of all order."""

import math
from collections.abc import Iterator

from mcloc.io.messages import Skipped

LEAP = 10.0  # s

Row = tuple[int, list[float]]
"""Number of a line, and its numbers, the first one seconds."""


def in_time(rows: Iterator[Row], what: str, skipped: Skipped) -> Iterator[Row]:
    """The rows but for those whose stamp leaps ahead of the next one's: a single wrong one must not
    hold up all that come after it.
    """
    before, held = -math.inf, None
    for row in rows:
        if held is not None:
            if before <= row[1][0] < held[1][0] - LEAP:
                skipped[f"{what} stamp from the future"] += 1
            else:
                yield held
                before = held[1][0]
        held = row
    if held is not None:
        yield held
