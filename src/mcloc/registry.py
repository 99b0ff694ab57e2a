"""One mechanism: name -> part, with its parameters, units, defaults and limits.

A part is a frozen dataclass; those of its fields that are made with `param` are its parameters.
Everything that lists, sets, checks or records parameters reads them from here.
"""

import dataclasses
import difflib
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Generic, TypeVar

from mcloc.errors import ConfigError

Value = float | int | str | bool
T = TypeVar("T")


def param(
    default: Value,
    unit: str,
    doc: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    above: float = -math.inf,
    choices: tuple[str, ...] = (),
) -> Any:
    """A parameter of a part: low ≤ value ≤ high, value > above; `unit` is "" for a pure number."""
    limits = {"unit": unit, "doc": doc, "low": low, "high": high, "above": above}
    return dataclasses.field(default=default, metadata={**limits, "choices": choices})


def parameters(part: Any) -> Iterator[dataclasses.Field[Any]]:
    """The fields of a part (class or instance) that are parameters."""
    return (f for f in dataclasses.fields(part) if "unit" in f.metadata)


class ParameterError(ConfigError):
    """A parameter that cannot be right. fault: what about it, beginning with its name.

    A part that was built as a class is named as that, one from a registry as its user names it.
    """

    def __init__(self, owner: str, fault: str) -> None:
        super().__init__(f"{owner}.{fault}")
        self.fault = fault


@contextmanager
def named(owner: str) -> Iterator[None]:
    """Errors about parameters name the part as its user does."""
    try:
        yield
    except ParameterError as error:
        raise ParameterError(owner, error.fault) from None


class Configurable:
    """Base of every registered part: checks its parameters when it is built."""

    def __post_init__(self) -> None:
        for field in parameters(self):
            value = getattr(self, field.name)
            fault = _fault(field, value)
            if fault:
                raise self.wrong(f"{field.name} {fault}")
            kind: type = type(field.default)
            object.__setattr__(self, field.name, kind(value))

    def wrong(self, fault: str) -> ParameterError:
        """The error to raise about a parameter; `fault` begins with its name."""
        return ParameterError(type(self).__name__, fault)


def _fault(field: dataclasses.Field[Any], value: Any) -> str:
    """Why `value` cannot be right for the parameter, "" where it can."""
    kind: type = type(field.default)
    limits = field.metadata
    if kind is bool or kind is str:
        if not isinstance(value, kind):
            return f"must be {kind.__name__}, got {value!r}"
        if limits["choices"] and value not in limits["choices"]:
            return f"must be one of {', '.join(limits['choices'])}, got {value!r}"
        return ""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        return f"must be a number, got {value!r}"
    if kind is int and value != int(value):
        return f"must be a whole number, got {value!r}"
    if not (limits["low"] <= value <= limits["high"] and value > limits["above"]):
        return f"= {value} {limits['unit']}".rstrip() + f" must be {_range(limits)}"
    return ""


def _range(limits: Mapping[str, Any]) -> str:
    parts = []
    if math.isfinite(limits["above"]):
        parts.append(f"> {limits['above']:g}")
    if math.isfinite(limits["low"]):
        parts.append(f">= {limits['low']:g}")
    if math.isfinite(limits["high"]):
        parts.append(f"<= {limits['high']:g}")
    return " and ".join(parts)


class Registry(Generic[T]):
    """Parts of one kind by name."""

    def __init__(self, kind: str, parts: Mapping[str, type[T]]) -> None:
        self.kind = kind
        self.parts = dict(parts)

    def get(self, name: str) -> type[T]:
        """The class behind a name. Raises ConfigError with the nearest names."""
        if name not in self.parts:
            raise ConfigError(f"unknown {self.kind} {name!r}; {suggest(name, self.parts)}")
        return self.parts[name]

    def make(self, name: str, *bound: Any, **settings: Any) -> T:
        """Build a part: `bound` goes to its leading fields (the map), `settings` to its
        parameters. Raises ConfigError for parameters that it does not have or that cannot be right.
        """
        cls = self.get(name)
        known = {f.name for f in parameters(cls)}
        for key in settings:
            if key not in known:
                raise ConfigError(
                    f"{self.kind} {name!r} has no parameter {key!r}; {suggest(key, known)}"
                )
        with named(self.kind):
            return cls(*bound, **settings)

    def __iter__(self) -> Iterator[str]:
        return iter(self.parts)


def suggest(name: str, known: Any) -> str:
    """What the user may have meant."""
    near = difflib.get_close_matches(name, list(known), n=1)
    listed = ", ".join(sorted(known)) or "it has none"
    return f"did you mean {near[0]!r}? known: {listed}" if near else f"known: {listed}"
