"""A reference trajectory from a ROS bag: the poses on one topic, at the stamps of their headers."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from mcloc.errors import LogError, TruthError
from mcloc.io.bag import Message, open_bag
from mcloc.io.bag_files import find_bag
from mcloc.io.bag_messages import (
    ODOMETRY,
    POSE,
    POSE_WITH_COVARIANCE,
    TRANSFORM,
    pose_matrix,
    seconds,
    transform_matrix,
)
from mcloc.io.bag_mounts import ODOM
from mcloc.io.frames import Transform, frame_name, planar
from mcloc.io.tum import FAR
from mcloc.trajectory import Trajectory

TYPES: dict[str, Callable[[Message], Transform]] = {
    POSE: lambda message: pose_matrix(message.pose),
    POSE_WITH_COVARIANCE: lambda message: pose_matrix(message.pose.pose),
    ODOMETRY: lambda message: pose_matrix(message.pose.pose),
    TRANSFORM: transform_matrix,
}


def read_truth(path: str | Path, topic: str) -> Trajectory:
    """The trajectory on a topic of PoseStamped, PoseWithCovarianceStamped, Odometry or
    TransformStamped.

    Messages without a stamp are left out. As in `read_trajectory`, poses out of order are sorted
    and of several with one stamp the first counts. Raises LogError for what is no bag or cannot be
    read, ConfigError for a topic that is not there or of another type, TruthError where no message
    has a stamp, for poses in a frame called odom and for one that is not finite or absurdly far
    off.
    """
    files = find_bag(path)
    if files is None:
        raise LogError(f"{path}: not a ROS bag, so it has no topic {topic!r}")
    rows = []
    with open_bag(files) as bag:
        name = bag.topic(topic, *TYPES)
        matrix = TYPES[bag.topics[name]]
        for _, message in bag.messages([name]):
            frame = frame_name(message.header.frame_id)
            if frame.rpartition("/")[2] == ODOM:
                raise TruthError(
                    f"{path}, {name}: is in the frame {frame!r}, not the map's; if its poses are "
                    "on the map all the same, as those of Stage are, give them as a CSV file"
                )
            t = seconds(message)
            if t is not None:
                rows.append([t, *planar(matrix(message))])
    if not rows:
        raise TruthError(f"{path}, {name}: holds no pose with a stamp")
    table = np.array(rows, dtype=np.float64)
    right = np.isfinite(table).all(axis=1) & (np.abs(table[:, 1:3]) < FAR).all(axis=1)
    if not right.all():
        raise TruthError(
            f"{path}, {name}: the pose at {table[np.argmin(right), 0]:.6f} s is not finite or "
            f"beyond {FAR:g} m"
        )
    stamps, first = np.unique(table[:, 0], return_index=True)
    return Trajectory(stamps, table[first, 1:])
