"""ROS 1's own rosbag: messages from JSON into a bag, and back. Run by Debian's Python.

ros1_bags.py write MESSAGES.json FILE.bag [none|bz2|lz4]
ros1_bags.py read FILE.bag MESSAGES.json

Messages are [{"topic", "type", "stamp": [s, ns], "message": {field: value}}], values by ROS's own
names of their fields; what is left out keeps its default.
"""

import json
import sys

import genpy
import rosbag
from roslib.message import get_message_class


def filled(type_name, value):
    """A value of a field's type."""
    if type_name == "time":
        return genpy.Time(value["sec"], value["nanosec"])
    if type_name.endswith("]"):
        element = type_name[: type_name.index("[")]
        return bytes(value) if element == "uint8" else [filled(element, each) for each in value]
    if not isinstance(value, dict):
        return value
    # A Header is `Header` or `std_msgs/Header`, as old definitions have it.
    name = "std_msgs/Header" if type_name == "Header" else type_name
    message = get_message_class(name)()
    types = dict(zip(message.__slots__, message._slot_types, strict=True))
    for field, of in value.items():
        setattr(message, field, filled(types[field], of))
    return message


def plain(value):
    """A message as JSON has it."""
    if isinstance(value, genpy.Message):
        return {field: plain(getattr(value, field)) for field in value.__slots__}
    if isinstance(value, genpy.Time):
        return {"sec": value.secs, "nanosec": value.nsecs}
    if isinstance(value, (list, tuple, bytes)):
        return [plain(each) for each in value]
    return value


def write(source, target, compression="none"):
    with (
        open(source, encoding="utf-8") as stream,
        rosbag.Bag(target, "w", compression=compression) as bag,
    ):
        for entry in json.load(stream):
            message = filled(entry["type"], entry["message"])
            bag.write(entry["topic"], message, genpy.Time(*entry["stamp"]))


def read(source, target):
    with rosbag.Bag(source) as bag, open(target, "w", encoding="utf-8") as stream:
        found = [
            {
                "topic": topic,
                "type": message._type,
                "stamp": [stamp.secs, stamp.nsecs],
                "message": plain(message),
            }
            for topic, message, stamp in bag.read_messages()
        ]
        json.dump(found, stream)


if __name__ == "__main__":
    {"write": write, "read": read}[sys.argv[1]](*sys.argv[2:])
