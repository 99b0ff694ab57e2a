"""A ROS bag: messages of chosen topics in the order of their recording, one at a time.

Files are opened by rosbags. It holds an index of the messages and the chunks in hand, never the
messages of a bag; only those of the wanted topics are taken apart.
"""

import heapq
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from mcloc.errors import ConfigError, LogError
from mcloc.io.bag_files import ROS1, BagFiles
from mcloc.io.messages import Skipped
from mcloc.io.ros_messages import typestore

Message = Any  # rosbags makes its classes from the definitions of the messages

MOST_LISTED = 40  # topics in one message to the user
LONGEST_CAUSE = 200  # characters
TF1 = ("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage")
SAME_AS = {"tf/tfMessage": "tf2_msgs/TFMessage"}  # before ROS Groovy


class Bag:
    """An open bag. path: as given. topics: the type of each; those known to be empty are left."""

    def __init__(self, files: BagFiles, readers: list[Any]) -> None:
        self.path = str(files.path)
        self._files = files
        self._readers = readers
        connections = [c for reader in readers for c in reader.connections]
        counted = any(c.msgcount for c in connections)  # an MCAP file may leave the counts out
        self.topics: dict[str, str] = {
            c.topic: _type(c.msgtype) for c in connections if c.msgcount or not counted
        }
        for name, kind in self.topics.items():
            if not (name.isprintable() and kind.isprintable()):
                raise LogError(f"{self.path}: a topic is called {name!r} ({kind!r}); damaged?")

    def of_type(self, *types: str) -> list[str]:
        """The topics of these types, by name."""
        return sorted(name for name, kind in self.topics.items() if kind in types)

    def topic(self, name: str, *types: str) -> str:
        """The topic that the user means, with its slash or without.

        Raises ConfigError where there is none of that name, or it has none of the types.
        """
        known = {topic.strip("/"): topic for topic in self.topics}
        found = known.get(name.strip("/"))
        if found is None:
            raise ConfigError(f"{self.path}: has no topic {name!r}; its topics: {self.listing()}")
        if self.topics[found] not in types:
            raise ConfigError(
                f"{self.path}: topic {found} is {self.topics[found]}, not {' or '.join(types)}; "
                f"its topics: {self.listing()}"
            )
        return found

    def listing(self) -> str:
        """The topics with their types, for messages to the user."""
        listed = [f"{name} ({self.topics[name]})" for name in sorted(self.topics)]
        more = len(listed) - MOST_LISTED
        return ", ".join(listed[:MOST_LISTED] + [f"and {more} more"] * (more > 0)) or "none"

    def messages(
        self, topics: Collection[str], skipped: Skipped | None = None
    ) -> Iterator[tuple[str, Message]]:
        """Topics and messages. Those that cannot be taken apart are counted in `skipped`.

        Raises LogError in mid-stream where the file is cut or spoilt.
        """
        skipped = Counter() if skipped is None else skipped
        with _faults(self._files, self._files.path):
            streams = []
            for reader in self._readers:
                wanted = [
                    c
                    for c in reader.connections
                    if c.topic in topics and _type(c.msgtype) == self.topics[c.topic]
                ]
                if wanted:  # rosbags takes an empty choice for all of them
                    streams.append(reader.messages(connections=wanted))
            for connection, _, raw in heapq.merge(*streams, key=lambda item: item[1]):
                message = self._deserialized(raw, self.topics[connection.topic])
                if message is None:
                    skipped[f"damaged message on {connection.topic}"] += 1
                else:
                    yield connection.topic, message

    def _deserialized(self, raw: bytes, kind: str) -> Message | None:
        ros1 = self._files.kind is ROS1
        store = _typestore(ros1)
        name = SAME_AS.get(kind, kind).replace("/", "/msg/")
        try:
            return (store.deserialize_ros1 if ros1 else store.deserialize_cdr)(raw, name)
        except Exception:  # spoilt bytes raise what they please there: IndexError, MemoryError, …
            return None


@contextmanager
def open_bag(files: BagFiles) -> Iterator[Bag]:
    """The bag, open within a `with` block. Raises LogError for what cannot be read."""
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

    reader = Reader1 if files.kind is ROS1 else Reader2
    with ExitStack() as stack:
        readers = []
        for part in files.parts:
            with _faults(files, part):
                readers.append(stack.enter_context(reader(part)))
        yield Bag(files, readers)


@contextmanager
def _faults(files: BagFiles, path: Path) -> Iterator[None]:
    """A damaged file makes rosbags raise nearly anything (struct.error, KeyError, AssertionError,
    and what sqlite, zstd and lz4 raise): for the user it is one fault.
    """
    try:
        yield
    except Exception as cause:
        said = " ".join(str(cause).split())[:LONGEST_CAUSE]
        own = type(cause).__name__ == "ReaderError"
        raise LogError(
            f"{path}: cannot be read as {files.kind.name} "
            f"({said if own else f'{type(cause).__name__}: {said}'}); where the recorder was "
            f"killed or the copy is cut, {files.kind.remedy} may help"
        ) from cause


@cache
def _typestore(ros1: bool) -> Any:
    """The definitions of the messages. Those read here have never changed within ROS 1 or ROS 2,
    so a bag's own definitions, which may be missing or spoilt, are not needed.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    if not ros1:
        return typestore()
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(*TF1))  # which rosbags leaves out
    return store


def _type(msgtype: str) -> str:
    return msgtype.replace("/msg/", "/")
