"""What the messages of a bag mean here: stamps in seconds, poses and transforms as matrices."""

from collections.abc import Iterator

from mcloc.io.bag import Message
from mcloc.io.frames import Transform, frame_name, transform

LASER_SCAN = "sensor_msgs/LaserScan"
IMAGE = "sensor_msgs/Image"
COMPRESSED_IMAGE = "sensor_msgs/CompressedImage"
ODOMETRY = "nav_msgs/Odometry"
TF = ("tf2_msgs/TFMessage", "tf/tfMessage")
GRID = "nav_msgs/OccupancyGrid"
POSE = "geometry_msgs/PoseStamped"
POSE_WITH_COVARIANCE = "geometry_msgs/PoseWithCovarianceStamped"
TRANSFORM = "geometry_msgs/TransformStamped"


def seconds(message: Message) -> float | None:
    """When it was measured, by its header, in seconds; None for a stamp that was never set."""
    stamp = message.header.stamp
    if stamp.sec == 0 and stamp.nanosec == 0:
        return None
    return float(stamp.sec + stamp.nanosec / 1e9)


def pose_matrix(pose: Message) -> Transform:
    """(4, 4) of a Pose, NaN for one that is none."""
    p, q = pose.position, pose.orientation
    return transform((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def transform_matrix(stamped: Message) -> Transform:
    """(4, 4) of a TransformStamped: the pose of its child frame in its header's frame."""
    p, q = stamped.transform.translation, stamped.transform.rotation
    return transform((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def edges(message: Message) -> Iterator[tuple[str, str, Message]]:
    """Parent frame, child frame and TransformStamped of each transform in a TFMessage."""
    for stamped in message.transforms:
        yield frame_name(stamped.header.frame_id), frame_name(stamped.child_frame_id), stamped
