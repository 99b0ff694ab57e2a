"""The program as a whole: help, version, models, and what it costs to start."""

import json
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest

import mcloc as package

Mcloc = Callable[..., Any]


def test_help_imports_nothing_heavy() -> None:
    program = (
        "import sys\n"
        "from mcloc.cli.main import app\n"
        "app(['--help'], standalone_mode=False)\n"
        "heavy = {'numpy', 'scipy', 'numba', 'matplotlib', 'rosbags', 'PIL', 'yaml'}\n"
        "print('heavy:', sorted(heavy & set(sys.modules)))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60
    )
    assert "Usage" in done.stdout
    assert done.stdout.endswith("heavy: []\n")


def test_version(mcloc: Mcloc) -> None:
    assert mcloc("--version").stdout == f"mcloc {package.__version__}\n"


@pytest.mark.parametrize("command", ["run", "eval", "info", "simulate", "models"])
def test_each_command_has_help(command: str, mcloc: Mcloc) -> None:
    done = mcloc(command, "--help")
    assert done.code == 0
    assert "Usage" in done.stdout


def test_models_lists_every_parameter(mcloc: Mcloc) -> None:
    from mcloc.filters.catalog import FILTERS, REGISTRIES
    from mcloc.registry import parameters

    listed = json.loads(mcloc("models", "--json").stdout)
    assert set(listed) == {"filter", *REGISTRIES, "update"}
    assert set(listed["filter"]) == set(FILTERS)
    shown = mcloc("models").stdout
    for kind, registry in REGISTRIES.items():
        assert set(listed[kind]) == set(registry)
        assert sum(model["default"] for model in listed[kind].values()) == 1
        for name in registry:
            for field in parameters(registry.get(name)):
                entry = listed[kind][name]["parameters"][field.name]
                assert entry["default"] == field.default
                assert entry["unit"] == field.metadata["unit"]
                assert f"{kind}.{field.name}" in shown


def test_every_public_name_is_there() -> None:
    for name in package.__all__:
        assert getattr(package, name) is not None
    assert set(package.__all__) <= set(dir(package))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        package.nothing  # noqa: B018
