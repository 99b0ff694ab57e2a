"""Messages between robots by Eclipse Zenoh: peers, no server.

Nothing is opened to a network unless an endpoint says so: without one a robot listens on loopback,
and nobody is searched for by multicast. Peers tell each other of the peers that they know.
"""

import json
import socket
import threading
import time
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from mcloc.errors import ConfigError
from mcloc.team.inbox import Arrival
from mcloc.team.letters import check_name
from mcloc.team.wire import MOST_BYTES

if TYPE_CHECKING:
    import zenoh

LOOPBACK = "tcp/127.0.0.1:0"
MOST_WAITING = 4096  # messages that nobody has asked for yet
LARGEST = 1 << 16  # bytes
"""Zenoh leaves out what is longer while it puts it together, so that nobody can fill the memory; it
does not say how often, and so that is not counted. What is shorter comes here.
"""

ALL, ONE = "all", "one"

_ROOT = "mcloc"


class Peers:
    """The connection of the robot `name` to its team. listening: the endpoints, with their ports.

    listen, connect: endpoints such as tcp/192.168.1.5:7447; port 0 is a free one. search: look for
    others by multicast, too. Raises ConfigError where Zenoh is not installed
    or an endpoint cannot be used, MessageError for a name that no robot can have.
    """

    def __init__(
        self,
        name: str,
        team: str = "team",
        *,
        listen: Sequence[str] = (LOOPBACK,),
        connect: Sequence[str] = (),
        search: bool = False,
    ) -> None:
        self.listening = [_with_port(endpoint) for endpoint in listen]
        self._name = check_name(name)
        self._waiting: deque[Arrival] = deque()
        self._dropped, self._news = 0, threading.Event()
        self._keys = f"{_ROOT}/{check_name(team)}"
        zenoh = _zenoh()
        settings = {
            "mode": "peer",
            "listen/endpoints": self.listening,
            "connect/endpoints": list(connect),
            "connect/timeout_ms": -1,  # for ever: a peer may come at any time
            "connect/exit_on_failure": False,
            "connect/retry": {"period_init_ms": 200, "period_max_ms": 2000},
            "scouting/multicast/enabled": search,
            "scouting/gossip/enabled": True,
            "transport/link/rx/max_message_size": LARGEST,
            "transport/shared_memory/enabled": False,
        }
        try:
            config = zenoh.Config()
            for key, value in settings.items():
                config.insert_json5(key, json.dumps(value))
            self._session = zenoh.open(config)
            self._mark = str(self._session.zid()).encode()
        except zenoh.ZError as cause:
            ends = ", ".join([*listen, *connect])
            raise ConfigError(
                f"cannot listen or connect at {ends}: endpoints are such as tcp/192.168.1.5:7447, "
                f"and a port can be taken by one only ({_short(cause)})"
            ) from cause
        self._subscribers = [
            self._session.declare_subscriber(f"{self._keys}/{key}", self._come)
            for key in (f"{ALL}/*", f"{ONE}/{name}/*")
        ]

    def clock(self) -> float:
        """s: the computer's clock."""
        return time.time()

    def send(self, data: bytes, to: str | None) -> None:
        """To the robot of this name, or to all; it never waits for them."""
        key = f"{ALL}/{self._name}" if to is None else f"{ONE}/{to}/{self._name}"
        self._session.put(f"{self._keys}/{key}", data, express=True, attachment=self._mark)

    def arrived(self) -> list[Arrival]:
        """What has come since it was last asked."""
        found = []
        while self._waiting:
            found.append(self._waiting.popleft())
        return found

    def wait(self, seconds: float) -> None:
        """Until something comes, or for so long."""
        if not self._waiting and self._news.wait(seconds):
            self._news.clear()

    def dropped(self) -> int:
        """How many messages came faster than they were asked for, and were left out."""
        return self._dropped

    def close(self) -> None:
        """No more is sent, and none comes."""
        self._session.close()

    def _come(self, sample: "zenoh.Sample") -> None:
        """In a thread of Zenoh's. A message that is too long is cut: it will be found to be."""
        clock, now = self.clock(), time.monotonic()
        sender = str(sample.key_expr).rpartition("/")[2]
        mark = sample.attachment
        if sender == self._name and mark is not None and mark.to_bytes() == self._mark:
            return  # an echo; another robot of this name is to be heard of
        if len(self._waiting) >= MOST_WAITING:
            self._dropped += 1
            return
        data = sample.payload.to_bytes()[: MOST_BYTES + 1]
        self._waiting.append(Arrival(data, sender, clock, now))
        self._news.set()


def _zenoh() -> Any:
    try:
        import zenoh
    except ImportError as cause:
        raise ConfigError(
            "robots find each other by Eclipse Zenoh, which is not installed: "
            "pip install 'mcloc[team]'"
        ) from cause
    return zenoh


def _with_port(endpoint: str) -> str:
    """The endpoint, with a port that is free in the place of 0: Zenoh would not say which it took.
    Raises ConfigError for what is none.
    """
    protocol, slash, address = endpoint.partition("/")
    host, colon, port = address.rpartition(":")
    if not (slash and colon and protocol and host and port):
        raise ConfigError(f"{endpoint!r} is no endpoint such as tcp/127.0.0.1:7447")
    if port != "0":
        return endpoint
    family = socket.AF_INET6 if host.startswith("[") else socket.AF_INET
    kind = socket.SOCK_DGRAM if protocol in ("udp", "quic") else socket.SOCK_STREAM
    try:
        with socket.socket(family, kind) as free:
            free.bind((host.strip("[]"), 0))
            return f"{protocol}/{host}:{free.getsockname()[1]}"
    except OSError as cause:
        raise ConfigError(f"{endpoint}: cannot be listened at ({cause.strerror})") from cause


def _short(cause: Exception) -> str:
    """Its first words, without where in Zenoh's sources it was raised."""
    return str(cause).partition(" at /")[0][:200]
