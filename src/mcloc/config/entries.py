"""Entries of a RunConfig as mappings: read from YAML, and overridden by those of a command line."""

import math
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from mcloc.config.run_config import CHOICES, RunConfig, Triple
from mcloc.config.yaml_file import read_yaml
from mcloc.errors import ConfigError
from mcloc.filters.catalog import REGISTRIES
from mcloc.registry import parameters, suggest


def read_entries(path: str | Path) -> dict[str, Any]:
    """What a YAML file says about a run: arguments of RunConfig, those that are null left out.

    Raises ConfigError, with the file and the entry, for unknown keys and values of a wrong kind.
    """
    return checked(str(path), read_yaml(path))


def checked(path: str, loaded: Mapping[Any, Any]) -> dict[str, Any]:
    """The same of what such a file holds; path: for messages."""
    known = [f.name for f in fields(RunConfig)]
    for key in loaded:
        if key not in known:
            raise ConfigError(f"{path}: unknown entry {key!r}; {suggest(str(key), known)}")
    return {
        key: _READERS.get(key, _text)(f"{path}: {key}", value)
        for key, value in loaded.items()
        if value is not None
    }


def merged(entries: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """`entries` with those of `over` in their place; `settings` parameter by parameter, `topics`
    role by role.

    A part that is exchanged for another one loses the settings that it had.
    """
    settings = dict(entries.get("settings", {}))
    for part in CHOICES:
        if part in over and over[part] != entries.get(part, getattr(RunConfig, part)):
            settings.pop(part, None)
    for part, values in over.get("settings", {}).items():
        settings[part] = {**settings.get(part, {}), **values}
    both = {**entries, **over, "settings": settings}
    if "topics" in over:
        both["topics"] = {**entries.get("topics", {}), **over["topics"]}
    return both


def limited(entries: Mapping[str, Any], particles: int) -> dict[str, Any]:
    """`entries` with so many particles, or where their number adapts, with at most so many."""
    if particles < 1:
        raise ConfigError(f"a filter needs at least one particle, got {particles}")
    size = REGISTRIES["size"].get(entries.get("size", RunConfig.size))
    defaults = {f.name: f.default for f in parameters(size)}
    if "particles" not in defaults and "maximum" not in defaults:
        raise ConfigError("--particles: recorded sizes are what the file says; leave it out")
    wanted = {"particles": particles}
    if "particles" not in defaults:
        given = entries.get("settings", {}).get("size", {})
        wanted = {"maximum": particles}
        if _number("size.minimum", given.get("minimum", defaults["minimum"])) > particles:
            wanted["minimum"] = particles
    settings = {"size": wanted}
    # Some filters have a number of their own, for when they search.
    composed = parameters(REGISTRIES["filter"].get(entries.get("filter", RunConfig.filter)))
    own = {f.name: f.default for f in composed}
    if "particles" in own:
        given = entries.get("settings", {}).get("filter", {}).get("particles", own["particles"])
        if "particles" in defaults or _number("filter.particles", given) > particles:
            settings["filter"] = {"particles": particles}
    return merged(entries, {"settings": settings})


def _text(where: str, value: object) -> str:
    if not isinstance(value, str) or not value:
        raise ConfigError(f"{where} must be text, got {value!r}")
    return value


def _number(where: str, value: object) -> float:
    try:
        # YAML takes 1e-3 for text.
        number = math.nan if isinstance(value, bool) else float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise ConfigError(f"{where} must be a finite number, got {value!r}")
    return number


def _whole(where: str, value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ConfigError(f"{where} must be a whole number, got {value!r}")
    return value


def _flag(where: str, value: object) -> bool:
    if not isinstance(value, bool):
        raise ConfigError(f"{where} must be true or false, got {value!r}")
    return value


def _triple(where: str, value: object) -> Triple:
    if not isinstance(value, list) or len(value) != 3:
        raise ConfigError(f"{where} must be [x, y, theta] in m, m, rad, got {value!r}")
    x, y, theta = (_number(where, v) for v in value)
    return x, y, theta


def _settings(where: str, value: object) -> dict[str, dict[str, Any]]:
    if not isinstance(value, dict) or not all(isinstance(v, dict) for v in value.values()):
        raise ConfigError(f"{where} must hold part: {{parameter: value}}, got {value!r}")
    return {str(part): {str(k): v for k, v in of.items()} for part, of in value.items()}


def _topics(where: str, value: object) -> dict[str, str | list[str]]:
    if not isinstance(value, dict):
        raise ConfigError(f"{where} must hold role: topic, got {value!r}")
    return {
        str(role): [_text(f"{where}.{role}", name) for name in names]
        if isinstance(names, list)
        else _text(f"{where}.{role}", names)
        for role, names in value.items()
    }


_READERS: dict[str, Callable[[str, object], Any]] = {
    "initial": _triple,
    "initial_sigma": _triple,
    "mount": _triple,
    "start": _number,
    "end": _number,
    "robot": _whole,
    "scans": _flag,
    "derive_sonar": _whole,
    "seed": _whole,
    "threads": _whole,
    "settings": _settings,
    "topics": _topics,
}
