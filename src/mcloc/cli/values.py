"""Values that are written on a command line."""

import math

from mcloc.errors import ConfigError

Value = int | float | str

LARGEST_WHOLE = 2.0**53

Triple = tuple[float, float, float]

_UNITS = {"s": 1.0, "m": 60.0, "h": 3600.0}


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


def topics(assignments: list[str]) -> dict[str, str | list[str]]:
    """Each `role=topic` as {role: topic}, a list where a role has several. Raises ConfigError."""
    found: dict[str, list[str]] = {}
    for assignment in assignments:
        role, equals, name = (word.strip() for word in assignment.partition("="))
        if not (equals and role and name):
            raise ConfigError(f"--topic takes role=name, such as scan=/scan; got {assignment!r}")
        found.setdefault(role, []).append(name)
    return {role: names[0] if len(names) == 1 else names for role, names in found.items()}


def robots(option: str, text: str | None) -> tuple[int, ...] | None:
    """`1,3` as their numbers, `none` as no robot. Raises ConfigError for anything else."""
    if text is None or text.strip() == "none":
        return None if text is None else ()
    words = [word.strip() for word in text.split(",")]
    if not all(word.isascii() and word.isdigit() for word in words):
        raise ConfigError(f"{option} takes numbers of robots, such as 1,3, or none; got {text!r}")
    return tuple(int(word) for word in words)


def seconds(option: str, text: str) -> float:
    """`90`, `90s`, `5m` or `1h` in seconds. Raises ConfigError for anything else."""
    number, unit = (text[:-1], text[-1]) if text[-1:] in _UNITS else (text, "s")
    try:
        value = float(number) * _UNITS[unit]
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise ConfigError(f"{option} takes a time such as 90s, 5m or 1h, got {text!r}")
    return value


def varied(assignments: list[str]) -> dict[str, tuple[Value, ...]]:
    """Each `name=v1,v2,…` as {name: values}, whole numbers, numbers or text. Raises ConfigError."""
    found: dict[str, tuple[Value, ...]] = {}
    for assignment in assignments:
        name, equals, listed = (word.strip() for word in assignment.partition("="))
        words = [word.strip() for word in listed.split(",")]
        if not (equals and name and all(words)):
            raise ConfigError(
                "--vary takes name=value,value,..., such as sensor.sigma_hit=0.05,0.1; got "
                f"{assignment!r}"
            )
        if name in found:
            raise ConfigError(f"--vary {name} is given twice: list its values in one")
        values = tuple(_typed(word) for word in words)
        if len(set(values)) < len(values):
            raise ConfigError(f"--vary {name}: a value is given twice: {listed}")
        found[name] = values
    if not found:
        raise ConfigError("what is to be varied? Give --vary sensor.sigma_hit=0.05,0.1,0.2")
    return found


def _typed(word: str) -> Value:
    """A number where it is one; 1e4 is a whole one."""
    try:
        number = float(word)
    except ValueError:
        return word
    if not math.isfinite(number):
        return word
    whole = number.is_integer() and "." not in word and abs(number) < LARGEST_WHOLE
    return int(number) if whole else number
