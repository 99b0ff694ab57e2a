"""A parameter file of amcl: where in it the node stands, which node it is, and its values."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mcloc.config.amcl import ROS1_DEFAULTS, ROS1_NAMES, ROS2_NAMES, Amcl
from mcloc.config.yaml_file import read_yaml
from mcloc.errors import ConfigError

Notes = list[str]
"""Lines to the user: what of a file is not taken over, or only nearly."""

Part = tuple[str, dict[str, Any]]
"""A part's name and its settings."""


@dataclass(frozen=True)
class AmclFile:
    """A parameter file.

    values: complete, with the node's own defaults. given: the names in `values` of those that the
    file has. others: the file's further names with their values. ros1: which node.
    """

    values: Amcl
    given: frozenset[str]
    others: Mapping[str, Any]
    ros1: bool

    @property
    def names(self) -> dict[str, str]:
        """{name in the file: name in `values`} of all that the node knows."""
        return ROS1_NAMES if self.ros1 else ROS2_NAMES

    def written(self, name: str) -> str:
        """How the file calls a parameter."""
        return next(key for key, known in self.names.items() if known == name)


def read_amcl(path: str | Path) -> AmclFile:
    """The parameters in a YAML file of nav2 or ROS 1, `amcl` in any namespace or at the top.

    Raises ConfigError, with the file and the name, where there is no amcl or more than one, and for
    values of a wrong kind or outside what they can be.
    """
    tree = read_yaml(path)
    found, ros1 = _ros2_section(path, tree), False
    if found is None:
        found, ros1 = _ros1_section(path, tree), True
    known = ROS1_NAMES if ros1 else ROS2_NAMES
    values = ROS1_DEFAULTS if ros1 else Amcl()
    for key, value in found.items():
        if key in known:
            try:
                values = replace(values, **{known[key]: _number(value, values, known[key])})
            except ConfigError as cause:
                raise ConfigError(f"{path}: {key}: {cause}") from None
    return AmclFile(
        values,
        frozenset(known[key] for key in found if key in known),
        {key: value for key, value in found.items() if key not in known},
        ros1,
    )


def _number(value: Any, values: Amcl, name: str) -> Any:
    """YAML takes 1e-3 for text."""
    if isinstance(value, str) and not isinstance(getattr(values, name), str):
        try:
            return float(value)
        except ValueError:
            pass
    return value


def _ros2_section(path: str | Path, tree: dict[Any, Any]) -> dict[str, Any] | None:
    """The parameters of the node amcl, those of the wildcard `/**` beneath; None for ROS 1."""
    nodes = [(name, _flat(of)) for name, of in _nodes(tree, "ros__parameters")]
    if not nodes:
        return None
    own = [(name, of) for name, of in nodes if name[-1:] == ("amcl",)]
    general = [of for name, of in nodes if name and set(name) <= {"*", "**"}]
    shared = {key: value for of in general for key, value in of.items()}
    if len(own) > 1:
        raise ConfigError(
            f"{path}: holds several amcl nodes, {', '.join('/'.join(n) for n, _ in own)}; "
            "leave one in the file"
        )
    if not own and not shared.keys() & ROS2_NAMES.keys():
        named = ", ".join(sorted({"/".join(name) or "none" for name, _ in nodes}))
        raise ConfigError(
            f"{path}: no parameters of amcl, only of {named}; "
            "give the file with `amcl: ros__parameters:`"
        )
    return shared | (own[0][1] if own else {})


def _ros1_section(path: str | Path, tree: dict[Any, Any]) -> dict[str, Any]:
    """What stands below `amcl`, or at the top where the file is about it alone."""
    own = [(name, _flat(of)) for name, of in _nodes(tree, "amcl")]
    if len(own) > 1:
        raise ConfigError(
            f"{path}: holds several amcl nodes, in {', '.join('/'.join(n) or '/' for n, _ in own)};"
            " leave one in the file"
        )
    found = own[0][1] if own else _flat(tree)
    if not found.keys() & ROS1_NAMES.keys():
        raise ConfigError(
            f"{path}: no parameters of amcl; give the file with `amcl: ros__parameters:`"
        )
    return found


def _nodes(
    tree: Mapping[Any, Any], word: str, at: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], Mapping[Any, Any]]]:
    """The mappings below a key `word`, each with the names on the way to it."""
    for key, below in tree.items():
        if not isinstance(below, dict):
            continue
        parts = tuple(part for part in str(key).split("/") if part)
        if parts[-1:] == (word,):
            yield (*at, *parts[:-1]), below
        else:
            yield from _nodes(below, word, (*at, *parts))


def _flat(tree: Mapping[Any, Any], prefix: str = "") -> dict[str, Any]:
    """{"initial_pose": {"x": 1}} as {"initial_pose.x": 1}."""
    flat: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, dict):
            flat |= _flat(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat
