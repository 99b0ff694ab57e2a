"""Bags of every kind from one script: a list of (topic, type, fields), recorded 10 ms apart.

rosbags writes them, and mcap-ros2-support as a writer that shares nothing with it.
"""

from functools import cache

import numpy as np
import pytest
from mcap.writer import CompressionType
from mcap_ros2.writer import Writer as IndependentWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

SQLITE, MCAP = StoragePlugin.SQLITE3, StoragePlugin.MCAP
ROS1 = {
    "ros1": None,
    "ros1 bz2": Writer1.CompressionFormat.BZ2,
    "ros1 lz4": Writer1.CompressionFormat.LZ4,
}
ROS2 = {
    "sqlite": (SQLITE, CompressionMode.NONE),
    "sqlite messages": (SQLITE, CompressionMode.MESSAGE),
    "sqlite files": (SQLITE, CompressionMode.FILE),
    "mcap": (MCAP, CompressionMode.NONE),
    "mcap messages": (MCAP, CompressionMode.MESSAGE),
    "mcap files": (MCAP, CompressionMode.FILE),
    "mcap chunks": (MCAP, CompressionMode.STORAGE),
}
INDEPENDENT = {
    "independent": CompressionType.NONE,
    "independent lz4": CompressionType.LZ4,
    "independent zstd": CompressionType.ZSTD,
}
KINDS = [*ROS1, *ROS2, *INDEPENDENT]
STEP = 10_000_000  # ns between recorded messages
STAMP = 1_700_000_000  # s; today's clocks leave a stamp in float64 half a microsecond


@cache
def store(ros1):
    types = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_JAZZY)
    if ros1:  # rosbags leaves tf out of ROS 1; the second one is of the first years
        for name in ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"):
            types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
    return types


def stamp(t):
    return {"sec": int(t // 1), "nanosec": round(t % 1 * 1e9)}


def header(t, frame):
    return {"stamp": stamp(t), "frame_id": frame}


def vector(*values):
    return dict(zip("xyzw", map(float, values), strict=False))


def yaw(angle):
    return (0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2))


def scan(t, frame="laser", ranges=(1.0, 2.0, 3.0), topic="/scan", **fields):
    values = {
        "header": header(t, frame),
        "angle_min": -0.5,
        "angle_max": 0.5,
        "angle_increment": 0.5,
        "time_increment": 0.0,
        "scan_time": 0.1,
        "range_min": 0.25,
        "range_max": 8.0,
        "ranges": np.array(ranges, dtype=np.float32),
        "intensities": np.zeros(0, dtype=np.float32),
    }
    return topic, "sensor_msgs/msg/LaserScan", values | fields


def pose(x, y, q):
    return {"position": vector(x, y, 0.0), "orientation": vector(*q)}


def odometry(t, x=0.0, y=0.0, theta=0.0, topic="/odom", frame="odom", child="base", q=None):
    zero = vector(0, 0, 0)
    twist = {"twist": {"linear": zero, "angular": zero}, "covariance": np.zeros(36)}
    at = pose(x, y, yaw(theta) if q is None else q)
    values = {
        "header": header(t, frame),
        "child_frame_id": child,
        "pose": {"pose": at, "covariance": np.zeros(36)},
        "twist": twist,
    }
    return topic, "nav_msgs/msg/Odometry", values


def transform(t, parent, child, translation=(0, 0, 0), q=(0, 0, 0, 1)):
    return {
        "header": header(t, parent),
        "child_frame_id": child,
        "transform": {"translation": vector(*translation), "rotation": vector(*q)},
    }


def tf(*transforms, topic="/tf"):
    return topic, "tf2_msgs/msg/TFMessage", {"transforms": list(transforms)}


def tf_static(*transforms):
    return tf(*transforms, topic="/tf_static")


def message(types, name, fields):
    """The nested dict as a message of rosbags; ROS 1 headers have a sequence number too."""
    if name == "std_msgs/msg/Header" and "seq" in dict(types.fielddefs[name][1]):
        fields = {"seq": 0, **fields}
    definitions = dict(types.fielddefs[name][1])

    def value(definition, given):
        detail = definition[1]
        if isinstance(given, dict):
            return message(types, detail, given)
        if isinstance(given, list) and given and isinstance(given[0], dict):
            return [message(types, detail[0][1], item) for item in given]
        return given

    return types.types[name](**{k: value(definitions[k], v) for k, v in fields.items()})


def plain(fields):
    """Arrays as lists, which the independent writer asks for."""
    if isinstance(fields, dict):
        return {key: plain(value) for key, value in fields.items()}
    if isinstance(fields, list):
        return [plain(value) for value in fields]
    return fields.tolist() if isinstance(fields, np.ndarray) else fields


def _script_with_rosbags(writer, script, types, serialize, start):
    connections = {}
    for i, (topic, kind, fields) in enumerate(script):
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, kind, typestore=types)
        if fields is None:
            continue
        raw = fields if isinstance(fields, bytes) else serialize(message(types, kind, fields), kind)
        writer.write(connections[topic], start + i * STEP, raw)


def write_bag(path, script, kind="mcap", start=STAMP * 10**9):
    """The bag's path: a file for ROS 1 and the independent writer, else a folder.

    Fields that are bytes are written as they are, a spoilt message; None is a silent topic.
    """
    if kind in ROS1:
        path = path.with_suffix(".bag")
        writer = Writer1(path)
        if ROS1[kind] is not None:
            writer.set_compression(ROS1[kind])
        types = store(True)
        with writer:
            _script_with_rosbags(writer, script, types, types.serialize_ros1, start)
        return path
    types = store(False)
    if kind in ROS2:
        plugin, mode = ROS2[kind]
        writer = Writer2(path, version=8, storage_plugin=plugin)
        if mode is not CompressionMode.NONE:
            writer.set_compression(mode, CompressionFormat.ZSTD)
        with writer:
            _script_with_rosbags(writer, script, types, types.serialize_cdr, start)
        return path
    path = path.with_suffix(".mcap")
    with path.open("wb") as stream:
        writer = IndependentWriter(stream, compression=INDEPENDENT[kind], chunk_size=4096)
        schemas = {}
        for i, (topic, name, fields) in enumerate(script):
            if name not in schemas:
                text = types.generate_msgdef(name, ros_version=2)[0]
                schemas[name] = writer.register_msgdef(name, text)
            at = start + i * STEP
            writer.write_message(topic, schemas[name], plain(fields), log_time=at, publish_time=at)
        writer.finish()
    return path


@pytest.fixture(params=KINDS)
def kind(request):
    """Every kind of bag, one after the other."""
    return request.param


@pytest.fixture
def write(tmp_path):
    """write(script, kind="mcap", name="drive") → the bag's path."""

    def write(script, kind="mcap", name="drive", **options):
        return write_bag(tmp_path / name, script, kind, **options)

    return write


class Ros:
    """What messages a script is made of."""

    STAMP = STAMP
    scan = staticmethod(scan)
    odometry = staticmethod(odometry)
    transform = staticmethod(transform)
    tf = staticmethod(tf)
    tf_static = staticmethod(tf_static)
    header = staticmethod(header)
    stamp = staticmethod(stamp)
    pose = staticmethod(pose)
    yaw = staticmethod(yaw)
    write_bag = staticmethod(write_bag)

    @staticmethod
    def drive(n=5, start=0.0):
        """One laser 0.2 m ahead of the base: n scans, each after an odometry reading."""
        script = [tf_static(transform(0.0, "base", "laser", (0.2, 0.0, 0.3)))]
        for i in range(n):
            t = STAMP + start + i / 4
            script += [odometry(t, x=i / 2), scan(t + 1 / 8)]
        return script


@pytest.fixture(scope="session")
def ros():
    return Ros
