"""Values that are written on a command line."""

import math

from mcloc.errors import ConfigError

Triple = tuple[float, float, float]


def pose(option: str, text: str | None) -> Triple | None:
    """`X,Y,THETA_DEG` as metres and radians. Raises ConfigError for anything else."""
    if text is None:
        return None
    try:
        x, y, degrees = (float(word) for word in text.split(","))
    except ValueError:
        raise ConfigError(
            f"{option} takes three numbers, metres, metres and degrees, such as 1.5,-2,90; "
            f"got {text!r}"
        ) from None
    return x, y, math.radians(degrees)


def settings(assignments: list[str]) -> dict[str, dict[str, str]]:
    """Each `part.name=value` as {part: {name: value}}. Raises ConfigError for anything else."""
    found: dict[str, dict[str, str]] = {}
    for assignment in assignments:
        name, equals, value = assignment.partition("=")
        part, dot, parameter = name.strip().partition(".")
        if not (equals and dot and part and parameter):
            raise ConfigError(
                f"--set takes part.name=value, such as sensor.sigma_hit=0.1; got {assignment!r}"
            )
        found.setdefault(part, {})[parameter] = value.strip()
    return found
