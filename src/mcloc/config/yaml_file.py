"""One YAML document that holds a mapping, or an error that names the line."""

from pathlib import Path
from typing import Any

from mcloc.errors import ConfigError
from mcloc.textfile import TextFile


def read_yaml(path: str | Path) -> dict[Any, Any]:
    """The mapping in a YAML file, gzip or not. Raises ConfigError for a file that holds none."""
    lines = TextFile(str(path), ConfigError).lines()
    return parse_yaml(str(path), "".join(line for _, line in lines))


def parse_yaml(path: str, text: str) -> dict[Any, Any]:
    """The mapping in a text; path: where it is from, for messages."""
    import yaml

    try:
        loaded = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as cause:
        mark = getattr(cause, "problem_mark", None)
        line = "" if mark is None else f", line {mark.line + 1}"
        raise ConfigError(f"{path}{line}: not YAML; is this the right file?") from cause
    if not isinstance(loaded, dict):
        raise ConfigError(f"{path}: holds no entries; give lines such as `map: map.yaml`")
    return loaded
