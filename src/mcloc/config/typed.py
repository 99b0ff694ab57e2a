"""The parameters of a part, as text or numbers, turned into what each of them is."""

from collections.abc import Mapping
from typing import Any, cast

from mcloc.errors import ConfigError
from mcloc.registry import Value, parameters, suggest


def typed(
    part: str, kind: type[Any], settings: Mapping[str, Value], owner: str | None = None
) -> dict[str, Value]:
    """The settings of a part of that kind, text turned into what each parameter is. owner: the part
    in messages. Raises ConfigError for parameters that it does not have, or values of a wrong kind.
    """
    known = defaults(kind)
    for name in settings:
        if name not in known:
            raise ConfigError(f"{owner or part} has no parameter {name!r}; {suggest(name, known)}")
    return {
        name: _value(f"{part}.{name}", value, type(known[name])) for name, value in settings.items()
    }


def defaults(part: type[Any]) -> dict[str, Value]:
    """{parameter: value} of a part."""
    return {f.name: cast(Value, f.default) for f in parameters(part)}


def check_path(where: str, text: str) -> None:
    """Raises ConfigError for what no config.yaml could name: bytes that are no UTF-8, or a NUL."""
    if "\0" in text or any("\ud800" <= letter <= "\udfff" for letter in text):
        raise ConfigError(f"{where} must be a name in UTF-8, got {text!a}; rename it")


def _value(where: str, value: Value, kind: type) -> Value:
    """`value` as the kind of the parameter; its limits are checked where the part is built."""
    if kind is bool and str(value).lower() in ("true", "false"):
        return str(value).lower() == "true"
    if kind is str and isinstance(value, str):
        check_path(where, value)
        return value
    if kind in (int, float) and not isinstance(value, bool):
        try:
            number = float(value)
        except (TypeError, ValueError):
            pass
        else:
            return int(number) if kind is int and number.is_integer() else number
    wanted = {bool: "true or false", str: "text"}.get(kind, "a number")
    raise ConfigError(f"{where} must be {wanted}, got {value!r}")
