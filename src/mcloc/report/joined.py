"""A robot of a team, in a process of its own: its log beside those of others."""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mcloc.config import RunConfig
from mcloc.errors import ConfigError, LogError
from mcloc.events import Detection, Event, Odometry
from mcloc.io.detections import among, read_detections
from mcloc.io.mrclam import Mrclam, is_mrclam
from mcloc.localizer import Estimate
from mcloc.maps.landmarks import Landmarks
from mcloc.maps.teammates import Teammates
from mcloc.registry import Configurable, Value
from mcloc.report.run import Run
from mcloc.report.team import OF_TEAM, TOLD_SIGMA, made, told_start_of, usual_detection
from mcloc.team.joining import Joining
from mcloc.team.look_ahead import LookAhead
from mcloc.team.member import Member
from mcloc.team.outbox import Carrier
from mcloc.team.peer_policy import PeerPolicy
from mcloc.team.post import Post
from mcloc.team.remarks import silent
from mcloc.team.team import PATIENCE

OF_MEMBER: Mapping[str, type[Configurable]] = {**OF_TEAM, "peers": PeerPolicy}
"""What has parameters to set besides the parts of a run."""


@dataclass(frozen=True)
class Joined:
    """How a robot joins a team.

    name: its own, by which others see it. peers: how many others it waits for before it begins.
    detections: path of a file of the robots that it saw, None for those of the log. landmarks:
    whether it uses the landmarks that it sees. told_start: whether it knows where it starts, by the
    truth about a robot of an MRCLAM folder, to TOLD_SIGMA. settings: {part: {parameter: value}} of
    OF_MEMBER.
    """

    name: str
    peers: int = 0
    detections: str | None = None
    landmarks: bool = True
    told_start: bool = False
    settings: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)


@dataclass(frozen=True)
class _TeamLog:
    """Events that can be gone through again."""

    events: Callable[[], Iterator[Event | Detection]]

    def __iter__(self) -> Iterator[Event | Detection]:
        return self.events()


class JoinedRun(Run):
    """One run of a robot that joins a team, whose messages `carrier` carries; else as any Run.

    member, joining: its part in the team. say: is told in words what somebody should know.
    """

    def __init__(
        self,
        config: RunConfig,
        joined: Joined,
        carrier: Carrier,
        say: Callable[[str], None] = silent,
    ) -> None:
        self.joined = joined
        super().__init__(_started(config, joined))
        usual = usual_detection(self.config) if is_mrclam(config.log) else {}
        of = joined.settings
        model = made("detection", OF_MEMBER["detection"], of, usual)
        if model.p_detect > 0.0:
            raise ConfigError(
                "detection.p_detect: robots in processes of their own tell each other of those "
                "that they see, not of those that they do not; leave it 0"
            )
        policy, peers = (made(part, OF_MEMBER[part], of) for part in ("team", "peers"))
        ahead = LookAhead(_TeamLog(self._team_events))
        post = Post(joined.name, carrier, peers)
        self.member = Member(self.localizer, post, model, policy, ahead.pop_wheels)
        self.joining = Joining(self.member, ahead, say)

    def by_event(self) -> Iterator[list[Estimate]]:
        """The estimates that each event makes possible, and what others told by then."""
        began = time.perf_counter() - self.wall_time
        for event in self.joining.run(self.joined.peers):
            self.consumed += 1
            found, self.localizer.withheld = self.member.taken()
            estimates = self._noted(found, began)
            if isinstance(event, Odometry):
                self.history.carry(self.localizer, event.t - PATIENCE)
            yield estimates
        if not len(self.history):
            raise LogError(
                f"{self.config.log}: the robot never had a place: it saw nothing that it knows of, "
                "and no other robot told it where it is"
            )

    def more(self) -> dict[str, Any]:
        """What became of its detections, and of the messages of others."""
        post, sizes = self.member.post, self.member.post.sizes
        return {
            "team": {
                "name": self.joined.name,
                "detections": {
                    "used": self.member.used,
                    "ignored": dict(sorted(self.member.ignored.items())),
                },
                "messages": {"dropped": dict(sorted(post.dropped.items()))},
                "message_bytes": {
                    "median": float(np.median(sizes)) if sizes else None,
                    "max": max(sizes, default=None),
                },
                "peers": {
                    peer.name: {
                        "starts": peer.sessions,
                        "clock_ahead_s": peer.offset.middle,
                        "not_awaited": self.joining.not_awaited[peer.name],
                        "differing": post.inbox.differing(peer),
                        "beyond_the_log": bool(self.joining.beyond[peer.name]),
                    }
                    for peer in post.inbox.peers.values()
                },
                "events_before": self.joining.skipped,
            }
        }

    def _all_aids(self) -> tuple[Any, ...]:
        """Those of the place, and the team."""
        seen = [
            aid
            for aid in super()._all_aids()
            if self.joined.landmarks or not isinstance(aid, Landmarks)
        ]
        return (*seen, Teammates())

    def _team_events(self) -> Iterator[Event | Detection]:
        """Those of the log between `start` and `end`, with the robots that were seen."""
        if is_mrclam(self.config.log):
            log = Mrclam(self.config.log, self.config.robot)
            mount = np.array(self.config.mount or (0.0, 0.0, 0.0))
            return self._within(log.team_events(mount, self.joined.landmarks))
        seen = self.joined.detections
        return self._within(among(self.log, [] if seen is None else read_detections(seen)))


def _started(config: RunConfig, joined: Joined) -> RunConfig:
    """With the start that is told, if one is."""
    if not joined.told_start:
        return config
    if not is_mrclam(config.log):
        raise ConfigError(
            "--told-start: the truth about the start is that of an MRCLAM folder; give --initial"
        )
    log = Mrclam(config.log, config.robot)
    x, y, theta = told_start_of(log, log.truth).tolist()
    return replace(config, initial=(x, y, theta), initial_sigma=TOLD_SIGMA)
