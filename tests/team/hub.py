"""Carriers that lose, delay, repeat and shuffle what they carry."""

import threading
import time
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from mcloc.team.inbox import Arrival
from mcloc.team.letters import Farewell, Heartbeat
from mcloc.team.wire import decoded


@dataclass
class Faults:
    """loss, twice: shares of messages. delay: s, of each message; jitter: s, at most more, each its
    own. ahead: s, of the robot's clock. dies_after: letters, then the process is killed.
    """

    loss: float = 0.0
    twice: float = 0.0
    delay: float = 0.0
    jitter: float = 0.0
    ahead: float = 0.0
    dies_after: int = 0


@dataclass
class Faulty:
    """Another carrier with faults in what is sent. letters: each that was to be sent, as (to,
    number); delivered: those that were, at least once; killed: what is done at the end.
    """

    carrier: object
    faults: Faults
    seed: int = 1
    kill: object = None
    letters: set = field(default_factory=set)
    delivered: set = field(default_factory=set)

    def __post_init__(self):
        self.rng, self.lock = np.random.default_rng(self.seed), threading.Lock()

    def clock(self):
        return self.carrier.clock() + self.faults.ahead

    def send(self, data, to):
        sent, said = decoded(data)
        letter = None if isinstance(said, Heartbeat | Farewell) else (to, sent.number)
        if letter:
            self.letters.add(letter)
            if self.kill and 0 < self.faults.dies_after <= len(self.letters):
                self.kill()
        with self.lock:
            lost, twice, jitter = self.rng.random(3)
        if lost < self.faults.loss:
            return
        if letter:
            self.delivered.add(letter)
        for _ in range(1 + (twice < self.faults.twice)):
            self._later(self.faults.delay + self.faults.jitter * jitter, data, to)

    def _later(self, seconds, data, to):
        if seconds == 0.0:
            self.carrier.send(data, to)
            return
        timer = threading.Timer(seconds, self._send_if_open, (data, to))
        timer.daemon = True
        timer.start()

    def _send_if_open(self, data, to):
        try:
            self.carrier.send(data, to)
        except Exception:  # the run is over, and the carrier closed
            return

    def arrived(self):
        return [
            Arrival(a.data, a.sender, a.clock + self.faults.ahead, a.now)
            for a in self.carrier.arrived()
        ]

    def wait(self, seconds):
        self.carrier.wait(seconds)

    def dropped(self):
        return self.carrier.dropped()

    def close(self):
        self.carrier.close()


class Hub:
    """Carries bytes between the robots of one process."""

    def __init__(self):
        self.robots = {}

    def carrier(self, name):
        self.robots[name] = HubCarrier(self, name)
        return self.robots[name]


class HubCarrier:
    def __init__(self, hub, name):
        self.hub, self.name, self.waiting, self.news = hub, name, deque(), threading.Event()

    def clock(self):
        return time.time()

    def send(self, data, to):
        for name, other in list(self.hub.robots.items()):
            if name != self.name and to in (None, name):
                other.waiting.append(Arrival(data, self.name, time.time(), time.monotonic()))
                other.news.set()

    def arrived(self):
        found = []
        while self.waiting:
            found.append(self.waiting.popleft())
        return found

    def wait(self, seconds):
        if not self.waiting and self.news.wait(seconds):
            self.news.clear()

    def dropped(self):
        return 0

    def close(self):
        self.hub.robots.pop(self.name, None)
