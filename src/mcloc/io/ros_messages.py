"""What mcloc knows as ROS 2 messages: the units and frames are the same, only the shape changes.

pose        z = 0, q = (0, 0, sin θ/2, cos θ/2)  [REP 103]
covariance  of (x, y, θ): rows and columns 0, 1, 5 of the 6 × 6 (x, y, z, turns about x, y, z)
grid        rows from the lowest y on, 0 … 100 in percent, −1 unknown: as OccupancyGrid has it
"""

import math
from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.events import Odometry, Scan
from mcloc.geometry import Pose, Poses
from mcloc.maps.occupancy import OccupancyGrid

Message = Any  # rosbags makes its classes from the definitions of the messages

LAST = 2**31  # s; a stamp's seconds are an int32
PLANAR = (0, 1, 5)  # x, y, θ among the six axes of a body
SAME_STEP = 1e-3  # rad


@cache
def typestore() -> Any:
    """The definitions of the messages; those used here are the same in every ROS 2."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


def nanoseconds(t: float) -> int:
    """A stamp in whole nanoseconds; 0 becomes 1, for in ROS 0 says that there is none.

    Raises ConfigError for one that ROS cannot express.
    """
    if not 0.0 <= t < LAST:
        raise ConfigError(
            f"a stamp of a bag must be from 0 to {LAST} s, got {t} s; shift the log's clock"
        )
    whole = int(t)
    stamp = whole * 10**9 + round((t - whole) * 1e9)  # t * 1e9 would round once more
    return max(stamp, 1)


def laser_scan(scan: Scan, frame: str) -> Message:
    """LaserScan, float32 as ROS has it. Raises ConfigError for beams at unequal steps, or none."""
    angles, n = np.unwrap(scan.angles), len(scan.angles)
    if n == 0:
        raise ConfigError(f"the scan of {scan.source} at {scan.t} s has no beams")
    first, last = float(angles[0]), float(angles[-1])
    if not (np.abs(angles - np.linspace(first, last, n)) <= SAME_STEP).all():
        raise ConfigError(
            f"the beams of {scan.source} are not at equal steps, as a LaserScan must have them"
        )
    with np.errstate(over="ignore"):  # beyond float32 is no return either
        ranges = scan.ranges.astype(np.float32)
        limits = np.array([scan.range_min, scan.range_max], dtype=np.float32)
    return _make(
        "sensor_msgs/msg/LaserScan",
        header=_header(scan.t, frame),
        angle_min=first,
        angle_max=last,
        angle_increment=(last - first) / max(n - 1, 1),
        time_increment=0.0,
        scan_time=0.0,
        range_min=float(limits[0]),
        range_max=float(limits[1]),
        ranges=ranges,
        intensities=np.zeros(0, dtype=np.float32),
    )


def odometry(odom: Odometry, frame: str, child: str) -> Message:
    """Odometry; velocities and covariances are not known and 0."""
    zero = _make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    return _make(
        "nav_msgs/msg/Odometry",
        header=_header(odom.t, frame),
        child_frame_id=child,
        pose=_pose_with_covariance(odom.pose, np.zeros((3, 3))),
        twist=_make(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=_make("geometry_msgs/msg/Twist", linear=zero, angular=zero),
            covariance=np.zeros(36),
        ),
    )


def transforms(placed: Iterable[tuple[float, str, str, Pose]]) -> Message:
    """TFMessage of (t, parent frame, child frame, pose of the child in the parent)."""
    return _make(
        "tf2_msgs/msg/TFMessage",
        transforms=[
            _make(
                "geometry_msgs/msg/TransformStamped",
                header=_header(t, parent),
                child_frame_id=child,
                transform=_make(
                    "geometry_msgs/msg/Transform",
                    translation=_make(
                        "geometry_msgs/msg/Vector3", x=float(pose[0]), y=float(pose[1]), z=0.0
                    ),
                    rotation=_quaternion(float(pose[2])),
                ),
            )
            for t, parent, child, pose in placed
        ],
    )


def occupancy_grid(t: float, grid: OccupancyGrid, frame: str) -> Message:
    """OccupancyGrid; the thresholds of the map have no place in it."""
    height, width = grid.cells.shape
    return _make(
        "nav_msgs/msg/OccupancyGrid",
        header=_header(t, frame),
        info=_make(
            "nav_msgs/msg/MapMetaData",
            map_load_time=_time(t),
            resolution=float(grid.resolution),
            width=width,
            height=height,
            origin=_pose(grid.origin),
        ),
        data=grid.cells.ravel(),
    )


def pose(t: float, at: Pose, covariance: NDArray[np.float64] | None, frame: str) -> Message:
    """PoseStamped, or PoseWithCovarianceStamped where the covariance (3, 3) is known."""
    if covariance is None:
        return _pose_stamped(t, at, frame)
    return _make(
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        header=_header(t, frame),
        pose=_pose_with_covariance(at, covariance),
    )


def pose_array(t: float, poses: Poses, frame: str) -> Message:
    """PoseArray of the poses (N, 3)."""
    return _make(
        "geometry_msgs/msg/PoseArray",
        header=_header(t, frame),
        poses=[_pose(at) for at in poses],
    )


def path(stamps: Sequence[float], poses: Sequence[Pose], frame: str) -> Message:
    """Path of at least one pose, stamped as its last one."""
    stamped = zip(stamps, poses, strict=True)
    return _make(
        "nav_msgs/msg/Path",
        header=_header(stamps[-1], frame),
        poses=[_pose_stamped(t, at, frame) for t, at in stamped],
    )


def _make(kind: str, **fields: Any) -> Message:
    return typestore().types[kind](**fields)


def _time(t: float) -> Message:
    seconds, rest = divmod(nanoseconds(t), 10**9)
    return _make("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)


def _header(t: float, frame: str) -> Message:
    return _make("std_msgs/msg/Header", stamp=_time(t), frame_id=frame)


def _quaternion(theta: float) -> Message:
    half = theta / 2.0
    return _make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(half), w=math.cos(half))


def _pose(at: Pose) -> Message:
    x, y, theta = at.tolist()
    point = _make("geometry_msgs/msg/Point", x=x, y=y, z=0.0)
    return _make("geometry_msgs/msg/Pose", position=point, orientation=_quaternion(theta))


def _pose_stamped(t: float, at: Pose, frame: str) -> Message:
    return _make("geometry_msgs/msg/PoseStamped", header=_header(t, frame), pose=_pose(at))


def _pose_with_covariance(at: Pose, covariance: NDArray[np.float64]) -> Message:
    full = np.zeros((6, 6))
    full[np.ix_(PLANAR, PLANAR)] = covariance
    return _make("geometry_msgs/msg/PoseWithCovariance", pose=_pose(at), covariance=full.ravel())
