"""Real ROS, each version in a Python of its own, as something that writes and reads bags."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent
ROS1_PYTHON = Path("/usr/bin/python3")  # Debian's packages are for Debian's Python
ROS2_PYTHON = HERE.parents[1] / ".venv-ros2" / "bin" / "python"

Messages = list[dict[str, Any]]


@dataclass(frozen=True)
class Ros:
    """One version of ROS: its Python and the script that it runs."""

    python: Path
    script: Path

    def write(self, messages: Messages, bag: Path, *options: str) -> None:
        """Messages, see ros1_bags.py, into a bag."""
        source = bag.with_name(f"{bag.name}.json")
        source.write_text(json.dumps(messages), encoding="utf-8")
        self._run("write", source, bag, *options)

    def read(self, bag: Path) -> Messages:
        """The messages of a bag in the order of the file."""
        target = bag.with_name(f"{bag.name}.read.json")
        self._run("read", bag, target)
        found: Messages = json.loads(target.read_text(encoding="utf-8"))
        return found

    def _run(self, *arguments: object) -> None:
        command = [str(self.python), str(self.script), *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True, env=_environment())
        assert done.returncode == 0, done.stderr


def _environment() -> dict[str, str]:
    """Without what makes a Python look into another one's packages."""
    return {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL_ENV"))}


def _found(python: Path, script: str, needed: str, version: str) -> Ros:
    """Skips where there is none."""
    if sys.platform == "linux" and python.exists():
        command = [str(python), "-c", f"import {needed}"]
        if subprocess.run(command, capture_output=True, env=_environment()).returncode == 0:
            return Ros(python, HERE / script)
    pytest.skip(f"{version} is not installed; .ci/ros_env.sh does what it can")


@pytest.fixture(scope="session")
def ros1() -> Ros:
    """rosbag of ROS 1."""
    needed = "rosbag, sensor_msgs.msg, nav_msgs.msg, tf2_msgs.msg"
    return _found(ROS1_PYTHON, "ros1_bags.py", needed, "ROS 1")


@pytest.fixture(scope="session")
def ros2() -> Ros:
    """rclpy of ROS 2, with MCAP."""
    needed = "rclpy.serialization, sensor_msgs.msg, nav_msgs.msg, mcap"
    return _found(ROS2_PYTHON, "ros2_bags.py", needed, "ROS 2")
