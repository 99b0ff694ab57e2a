"""Finding: something that looks wrong, by what numbers, and what would mend it."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Finding:
    """check: which check found it, a name that stays, such as "map-inverted". about: the map, the
    log, a laser or the odometry of the log. what, evidence, remedy: for people.
    """

    check: str
    about: str
    what: str
    evidence: str
    remedy: str
