"""ROS 2's own serialization (rclpy) and MCAP's own files: messages from JSON into a bag, and back.
Run by the Python of the environment that .ci/ros_env.sh makes.

ros2_bags.py write MESSAGES.json FILE.mcap|FILE.db3 [none|zstd|lz4]
ros2_bags.py read FILE.mcap MESSAGES.json

Messages as in ros1_bags.py. Reading also tells by "whole" whether rclpy would have written as many
bytes (their values cannot be compared: it leaves padding as it finds it). There are no wheels of
rosbag2_py: a .db3 is made with the tables that rosbag2 gives it. Nor are there any of tf2_msgs: a
TFMessage is a count and its TransformStamped, one after the other.
"""

import json
import sqlite3
import struct
import sys
from importlib import import_module
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rclpy.serialization import deserialize_message, serialize_message

TF = "tf2_msgs/msg/TFMessage"
TRANSFORM = "geometry_msgs/msg/TransformStamped"
HEADER = 4  # bytes that say how a message is serialized
DOUBLES = 7 * 8  # bytes of a transform


def class_of(type_name):
    package, _, name = type_name.replace("/msg/", "/").partition("/")
    return getattr(import_module(f"{package}.msg"), name)


def filled(message, fields):
    """The message with these values."""
    types = message.get_fields_and_field_types()
    for field, value in fields.items():
        if isinstance(value, dict):
            filled(getattr(message, field), value)
        elif value and isinstance(value, list) and isinstance(value[0], dict):
            element = class_of(types[field].removeprefix("sequence<").removesuffix(">"))
            setattr(message, field, [filled(element(), each) for each in value])
        else:
            setattr(message, field, value)
    return message


def plain(value):
    """A message as JSON has it."""
    if hasattr(value, "get_fields_and_field_types"):
        return {field: plain(getattr(value, field)) for field in value.get_fields_and_field_types()}
    if isinstance(value, (str, int, float)):
        return value
    return [plain(each) for each in value] if hasattr(value, "__len__") else value.item()


def moved(data, at, to):
    """A serialized transform for another place in a message: its doubles start at multiples of 8,
    so the padding before them depends on where it begins.
    """
    names = 8
    for _ in range(2):
        names += -names % 4
        (length,) = struct.unpack_from("<I", data, names)
        names += 4 + length
    start = names + -(at + names) % 8
    padding = bytes(-(to + names) % 8)
    return data[:names] + padding + data[start : start + DOUBLES]


def serialized(type_name, fields):
    if type_name != TF:
        return serialize_message(filled(class_of(type_name)(), fields))
    body = struct.pack("<I", len(fields["transforms"]))
    for each in fields["transforms"]:
        data = serialize_message(filled(class_of(TRANSFORM)(), each))
        head, rest = data[:HEADER], data[HEADER:]
        body += moved(rest, 0, len(body))
    return head + body


def deserialized(type_name, data):
    if type_name != TF:
        return plain(deserialize_message(data, class_of(type_name)))
    head, body = data[:HEADER], data[HEADER:]
    (count,) = struct.unpack_from("<I", body)
    found, at = [], 4
    for _ in range(count):
        alone = moved(body[at:], at, 0)
        found.append(plain(deserialize_message(head + alone, class_of(TRANSFORM))))
        at += len(moved(alone, 0, at))
    assert at == len(body)
    return {"transforms": found}


def definition(type_name):
    """A message's definition and those that it needs, as MCAP files hold them."""
    texts, wanted = {}, [type_name.replace("/msg/", "/")]
    while wanted:
        name = wanted.pop()
        if name in texts:
            continue
        package, _, message = name.partition("/")
        if name == "tf2_msgs/TFMessage":
            texts[name] = "geometry_msgs/TransformStamped[] transforms\n"
        else:
            path = Path(sys.prefix, "share", package, "msg", f"{message}.msg")
            texts[name] = path.read_text(encoding="utf-8")
        for line in texts[name].splitlines():
            kind = line.partition("#")[0].partition(" ")[0].partition("[")[0]
            if "/" in kind:
                wanted.append(kind)
            elif kind[:1].isupper():
                wanted.append(f"{package}/{kind}")
    (first, text), *others = texts.items()
    parts = [text, *(f"{'=' * 80}\nMSG: {name}\n{other}" for name, other in others)]
    assert first == type_name.replace("/msg/", "/")
    return "\n".join(parts).encode()


def write(source, target, compression="none"):
    entries = [
        (
            entry["topic"],
            entry["type"].replace("/", "/msg/"),
            entry["stamp"][0] * 10**9 + entry["stamp"][1],
            entry["message"],
        )
        for entry in json.loads(Path(source).read_text(encoding="utf-8"))
    ]
    (write_sqlite if target.endswith(".db3") else write_mcap)(entries, target, compression)


def write_mcap(entries, target, compression):
    with open(target, "wb") as stream:
        writer = Writer(stream, compression=CompressionType[compression.upper()])
        writer.start(profile="ros2", library="test")
        channels = {}
        for topic, type_name, stamp, fields in entries:
            if topic not in channels:
                schema = writer.register_schema(type_name, "ros2msg", definition(type_name))
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], stamp, serialized(type_name, fields), stamp)
        writer.finish()


def write_sqlite(entries, target, _):
    with sqlite3.connect(target) as db:
        db.executescript(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
            " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,"
            " timestamp INTEGER NOT NULL, data BLOB NOT NULL);"
            "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
        )
        topics = {}
        for topic, type_name, stamp, fields in entries:
            if topic not in topics:
                topics[topic] = len(topics) + 1
                row = (topics[topic], topic, type_name, "cdr", "")
                db.execute("INSERT INTO topics VALUES (?, ?, ?, ?, ?)", row)
            row = (topics[topic], stamp, serialized(type_name, fields))
            db.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", row)
    db.close()


def read(source, target):
    found = []
    with open(source, "rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            fields = deserialized(schema.name, message.data)
            found.append(
                {
                    "topic": channel.topic,
                    "type": schema.name.replace("/msg/", "/"),
                    "stamp": list(divmod(message.log_time, 10**9)),
                    "message": fields,
                    "whole": len(serialized(schema.name, fields)) == len(message.data),
                }
            )
    Path(target).write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    {"write": write, "read": read}[sys.argv[1]](*sys.argv[2:])
