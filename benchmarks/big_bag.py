"""How much memory `mcloc run` takes for a large bag: camera images beside the scans of a drive.

    python benchmarks/big_bag.py [--gigabytes 3] [--format mcap|ros1]

The images are noise, which no compression shrinks. The figure is the peak of the process's resident
memory (VmHWM, so Linux only), from a start pose and without a picture.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from mcloc.events import Odometry
from mcloc.io import ros_messages as ros
from mcloc.simulation import SimulatedDrive, office_drive

IMAGE = (480, 640, 3)  # height, width, colours
BYTES = int(np.prod(IMAGE))
BASE, LASER = "base_link", "laser"
LATER = 1.0  # s; a stamp of 0 is one that was never set

Write = Callable[[str, float, Any], None]

RUN = """
import sys
from mcloc.cli.main import main
try:
    main()
finally:
    with open("/proc/self/status") as status:
        peak = next(line.split()[1] for line in status if line.startswith("VmHWM"))
    print("peak", peak, file=sys.stderr)
"""


def write_bag(drive: SimulatedDrive, path: Path, size: float) -> None:
    """The drive as a bag of about `size` bytes: FILE.bag for ROS 1, else a folder with MCAP."""
    scans = [event for event in drive.events if not isinstance(event, Odometry)]
    noise = np.random.default_rng(0).integers(0, 256, 8 * BYTES, dtype=np.uint8)
    per_scan, written = size / len(scans), 0.0
    with (_ros1 if path.suffix == ".bag" else _mcap)(path) as write:
        mount = (LATER, BASE, LASER, scans[0].mount)
        write("/tf_static", LATER, ros.transforms([mount]))
        for event in drive.events:
            t = event.t + LATER
            if isinstance(event, Odometry):
                odometry = Odometry(t, event.pose)
                write("/odom", t, ros.odometry(odometry, "odom", BASE))
                continue
            scan = ros.laser_scan(event, LASER)
            scan.header.stamp.sec += int(LATER)
            write("/scan", t, scan)
            for _ in range(int(written + per_scan) // BYTES - int(written) // BYTES):
                start = np.random.default_rng(int(written)).integers(7 * BYTES)
                write("/camera", t, _image(scan.header, noise[start : start + BYTES]))
            written += per_scan


def _image(header: Any, pixels: np.ndarray) -> Any:
    height, width, colours = IMAGE
    return ros.typestore().types["sensor_msgs/msg/Image"](
        header=header,
        height=height,
        width=width,
        encoding="rgb8",
        is_bigendian=0,
        step=width * colours,
        data=pixels,
    )


@contextmanager
def _mcap(path: Path) -> Iterator[Write]:
    from rosbags.rosbag2 import StoragePlugin, Writer

    store = ros.typestore()
    connections: dict[str, Any] = {}
    with Writer(path, version=8, storage_plugin=StoragePlugin.MCAP) as writer:

        def write(topic: str, t: float, message: Any) -> None:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            data = store.serialize_cdr(message, kind)
            writer.write(connections[topic], ros.nanoseconds(t), data)

        yield write


@contextmanager
def _ros1(path: Path) -> Iterator[Write]:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store, old = ros.typestore(), get_typestore(Stores.ROS1_NOETIC)
    transforms = ("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage")
    old.register(get_types_from_msg(*transforms))  # which rosbags leaves out
    connections: dict[str, Any] = {}
    with Writer(path) as writer:

        def write(topic: str, t: float, message: Any) -> None:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=old)
            data = store.cdr_to_ros1(store.serialize_cdr(message, kind), kind)
            writer.write(connections[topic], ros.nanoseconds(t), data)

        yield write


def peak(gigabytes: float, format: str, folder: Path) -> float:
    """MB of memory that a run takes at its peak, on a bag of this size."""
    drive = office_drive(seed=1, length=40.0)
    bag = folder / ("drive.bag" if format == "ros1" else "drive")
    write_bag(drive, bag, gigabytes * 1e9)
    drive.grid.save(folder / "map.yaml")
    x, y, theta = drive.truth.poses[0]
    arguments = ["run", "--map", folder / "map.yaml", "--log", bag, "--out", folder / "out"]
    arguments += ["--initial", f"{x},{y},{np.degrees(theta)}", "--seed", 1, "--no-plot"]
    command = [sys.executable, "-c", RUN, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    return float(done.stderr.rsplit("peak", 1)[1]) / 1e3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gigabytes", type=float, default=3.0)
    parser.add_argument("--format", choices=("mcap", "ros1"), default="mcap")
    given = parser.parse_args()
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        found = peak(given.gigabytes, given.format, Path(folder))
    took = time.perf_counter() - began
    print(f"{given.gigabytes:g} GB {given.format}: peak {found:.0f} MB, {took:.0f} s with writing")


if __name__ == "__main__":
    main()
