"""A ROS 2 bag from mcloc values: a folder with metadata.yaml and one MCAP file, zstd in chunks.

It is written beside its place and moved there when it is complete. The stamps of the values are
the times of the recording too, so one input gives the same bytes. The metadata are of version 8,
the last one that every ROS 2 from Humble on reads.
"""

import os
import re
import shutil
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.events import Odometry, Scan
from mcloc.geometry import Pose, Poses
from mcloc.io import ros_messages as ros
from mcloc.maps.occupancy import OccupancyGrid

MAP, ODOM, BASE = "map", "odom", "base_link"  # the frames of REP 105
SAME_MOUNT = 1e-3  # m, rad; below it is the rounding of a log
_TOPIC = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


class BagWriter:
    """A bag to be written within a `with` block.

    folder: of the bag; it may be new, empty, or an earlier bag of that name, which is replaced.
    Where the block raises, the bag holds what came before; where nothing did, there is none. Every
    method raises ConfigError for a stamp, a topic or a scan that ROS cannot express, and where the
    bag cannot be written; of a failed bag nothing is left.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        self._place = self.folder.resolve()
        self._unfinished = self._place.with_name(f".{self._place.name}.unfinished")
        self._connections: dict[str, Any] = {}
        self._fixed: dict[str, tuple[float, str, str, Pose]] = {}
        self._failed = False

    def __enter__(self) -> Self:
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

        try:
            self._refuse_to_replace_other_files()
            if self._unfinished.exists():
                shutil.rmtree(self._unfinished)
            self._writer = Writer(
                self._unfinished / self._place.name, version=8, storage_plugin=StoragePlugin.MCAP
            )
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
        except OSError as cause:
            shutil.rmtree(self._unfinished, ignore_errors=True)
            raise self._fault(cause) from cause
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if self._failed or (error is not None and not self._connections):
                return
            self._writer.close()
            if self._place.exists():
                os.replace(self._place, self._unfinished / ".replaced")
            os.replace(self._unfinished / self._place.name, self._place)
        except OSError as cause:
            raise self._fault(cause) from cause
        finally:
            with suppress(OSError):
                self._writer.abort()
            shutil.rmtree(self._unfinished, ignore_errors=True)

    def scan(self, scan: Scan, base: str = BASE) -> None:
        """A LaserScan, its topic and its frame named after the scan's source; before the first
        one, and where the laser was moved, its mount in the frame `base` on /tf_static.
        """
        frame = scan.source.lstrip("/")
        known = self._fixed.get(frame)
        if known is None or np.abs(scan.mount - known[3]).max() > SAME_MOUNT:
            self.transform(scan.t, base, frame, scan.mount, static=True)
        self._write(f"/{frame}", scan.t, ros.laser_scan(scan, frame))

    def odometry(
        self, topic: str, odometry: Odometry, frame: str = ODOM, child: str = BASE
    ) -> None:
        """An Odometry message; velocities and covariances are not known and 0."""
        self._write(topic, odometry.t, ros.odometry(odometry, frame, child))

    def transform(
        self, t: float, parent: str, child: str, pose: Pose, static: bool = False
    ) -> None:
        """The pose of one frame in another, on /tf or on /tf_static.

        A player keeps one message of /tf_static for those who come late: each holds them all.
        """
        if not static:
            self._write("/tf", t, ros.transforms([(t, parent, child, pose)]))
            return
        self._fixed[child] = (t, parent, child, pose)
        self._write("/tf_static", t, ros.transforms(self._fixed.values()), latched=True)

    def grid(self, topic: str, t: float, grid: OccupancyGrid, frame: str = MAP) -> None:
        """An OccupancyGrid, kept by players for those who come late."""
        self._write(topic, t, ros.occupancy_grid(t, grid, frame), latched=True)

    def pose(
        self,
        topic: str,
        t: float,
        pose: Pose,
        covariance: NDArray[np.float64] | None = None,
        frame: str = MAP,
    ) -> None:
        """A PoseStamped, or with a covariance (3, 3) a PoseWithCovarianceStamped."""
        self._write(topic, t, ros.pose(t, pose, covariance, frame))

    def cloud(self, topic: str, t: float, poses: Poses, frame: str = MAP) -> None:
        """A PoseArray of the poses (N, 3)."""
        self._write(topic, t, ros.pose_array(t, poses, frame))

    def path(
        self, topic: str, stamps: Sequence[float], poses: Sequence[Pose], frame: str = MAP
    ) -> None:
        """A Path of at least one pose, at the stamp of its last one."""
        self._write(topic, stamps[-1], ros.path(stamps, poses, frame))

    def _write(self, topic: str, t: float, message: ros.Message, latched: bool = False) -> None:
        stamp, kind = ros.nanoseconds(t), message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._connect(topic, kind, latched)
        connection = self._connections[topic]
        if connection.msgtype != kind:
            raise ConfigError(f"{topic} holds {connection.msgtype}, it cannot hold {kind} too")
        data = ros.typestore().serialize_cdr(message, kind)
        try:
            self._writer.write(connection, stamp, data)
        except OSError as cause:
            self._failed = True
            raise self._fault(cause) from cause

    def _connect(self, topic: str, kind: str, latched: bool) -> Any:
        if not _TOPIC.fullmatch(topic):
            raise ConfigError(
                f"{topic!r} is no name of a ROS topic: / and words of letters, digits and _"
            )
        return self._writer.add_connection(
            topic, kind, typestore=ros.typestore(), offered_qos_profiles=[_qos(latched)]
        )

    def _refuse_to_replace_other_files(self) -> None:
        if not self._place.exists():
            return
        own = {"metadata.yaml", f"{self._place.name}.mcap"}
        if not self._place.is_dir() or {path.name for path in self._place.iterdir()} - own:
            raise ConfigError(f"{self.folder}: holds something else than a bag; name a new folder")

    def _fault(self, cause: OSError) -> ConfigError:
        return ConfigError(f"{self.folder}: the bag cannot be written ({cause.strerror})")


def _qos(latched: bool) -> Any:
    """As publishers offer it; latched (transient local): those who come late get the last one."""
    from rosbags import interfaces as qos

    never = qos.QosTime(9223372036, 854775807)
    durability = qos.QosDurability
    return qos.Qos(
        history=qos.QosHistory.KEEP_LAST,
        depth=1 if latched else 10,
        reliability=qos.QosReliability.RELIABLE,
        durability=durability.TRANSIENT_LOCAL if latched else durability.VOLATILE,
        deadline=never,
        lifespan=never,
        liveliness=qos.QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=never,
        avoid_ros_namespace_conventions=False,
    )
