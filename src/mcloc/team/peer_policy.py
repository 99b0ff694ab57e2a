"""What a robot of a team puts up with."""

from dataclasses import dataclass

from mcloc.registry import Configurable, param


@dataclass(frozen=True)
class PeerPolicy(Configurable):
    """How far apart clocks may be, and how long a robot waits for others."""

    clock_bound: float = param(
        0.5, "s", "messages of a robot whose clock is surely farther off are left out", above=0
    )
    silence: float = param(5.0, "s", "a robot that is not heard for so long is gone", above=0)
    patience: float = param(
        20.0, "s", "how long to wait for others to come, or for one that does not go on", low=0
    )
    reply_wait: float = param(10.0, "s", "how long to wait for a reply", low=0)
    again: float = param(1.0, "s", "a message without a reply is sent again after", above=0)
    heartbeat: float = param(0.25, "s", "between two heartbeats", above=0)
