"""A log, from its first event to its last, through the localizer that a config describes."""

import hashlib
import math
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Any, TypeVar

import numpy as np

from mcloc.config import RunConfig
from mcloc.errors import ConfigError, LogError, StateError
from mcloc.events import Detection, Event, Odometry, arrays_of
from mcloc.io.bag_map import read_map
from mcloc.io.bag_truth import read_truth
from mcloc.io.log import read_log
from mcloc.io.mrclam import Mrclam, is_mrclam
from mcloc.io.tum import read_trajectory
from mcloc.kernels.jit import set_threads
from mcloc.localizer import Estimate, Localizer
from mcloc.localizer.queue import LATENCY
from mcloc.maps.landmarks import Landmarks, open_floor
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.report.aids import aids_of, measured_log
from mcloc.report.history import History
from mcloc.trajectory import Trajectory

E = TypeVar("E", bound=Event | Detection)

MOST_BEYOND = 1000  # events after `end` in a row, then no more are looked at


class Run:
    """One run: iterate over it once to make it; what it finds stays in it, also when it breaks off.

    config: of the run, complete. grid, truth, aids: as loaded. localizer: its state after the last
    event. history: what it found at each scan so far. consumed: events of the log so far.
    wall_time: seconds of processing so far. Raises McLocError at once where the config, the map or
    the truth cannot be right, or the log cannot be opened; LogError in the middle of a log that is
    cut, or at the end of one without a usable scan, or if no pose was told at any.
    """

    def __init__(self, config: RunConfig) -> None:
        self.config = config.resolved()
        self.truth = _truth(config)
        self.aids = self._all_aids()
        self.grid = _grid(self.config)
        log = read_log(config.log, config.mount, config.sensor_topics, config.robot)
        self.log = measured_log(log, self.config, self.aids)
        if config.threads is not None:
            set_threads(config.threads)
        self.localizer = Localizer(
            self.grid,
            self.config.composition,
            aids=self.aids,
            seed=self.config.seed,
            initial=config.initial,
            initial_sigma=config.initial_sigma,
            policy=self.config.policy,
            pace=self.config.replay_pace,
        )
        self.history = History()
        self.history.sizes.add(0, 0, len(self.localizer.belief.particles))
        self.consumed = 0
        self.last_event: str | None = None  # fingerprint, of a run that is resumed
        self._last: Event | None = None
        self.wall_time = 0.0

    def __iter__(self) -> Iterator[Estimate]:
        for estimates in self.by_event():
            yield from estimates

    def by_event(self) -> Iterator[list[Estimate]]:
        """The estimates that each event makes possible. Between two of them the run is a whole: it
        can be saved.
        """
        began = time.perf_counter() - self.wall_time
        for event in self._events():
            self.consumed += 1
            self._last = event
            estimates = self._noted(self.localizer.process(event), began)
            if self.aids and isinstance(event, Odometry):
                estimates += self._follow(event.t - LATENCY, began)
            yield estimates
        yield self._noted(self.localizer.finish(), began)
        if not len(self.history):
            raise LogError(f"{self.config.log}: {self._nothing()}")

    def _all_aids(self) -> tuple[Any, ...]:
        """What else than walls the robot is localized by."""
        return aids_of(self.config)

    @property
    def landmarks(self) -> Landmarks | None:
        """Those that the robot sees, if any."""
        return next((aid for aid in self.aids if isinstance(aid, Landmarks)), None)

    @property
    def ignored(self) -> Counter[str]:
        """How many events were left out, by reason."""
        return self.localizer.ignored + Counter(self.log.skipped)

    def more(self) -> dict[str, Any]:
        """What else its summary tells."""
        return {}

    @property
    def read(self) -> str | None:
        """Fingerprint of the last event that was consumed."""
        return self.last_event if self._last is None else fingerprint(self._last)

    def _noted(self, estimates: list[Estimate], began: float) -> list[Estimate]:
        for estimate in estimates:
            self.history.add(estimate)
        for t, odometry in self.localizer.withheld:
            self.history.withhold(t, odometry)
        self.wall_time = time.perf_counter() - began
        return estimates

    def _follow(self, t: float, began: float) -> list[Estimate]:
        """Up to t by the wheels, where nothing has been measured for some time."""
        estimates = self._noted(self.localizer.follow(t), began)
        if self.landmarks is not None:
            self.history.carry(self.localizer, t)
        return estimates

    def _events(self) -> Iterator[Event]:
        """Those of the part of the log that was asked for; what was consumed already is passed
        over.
        """
        events, last = self._within(self.log), None
        for k in range(self.consumed):
            last = next(events, None)
            if last is None:
                raise StateError(
                    f"{self.config.log}: ends after {k} events, but the run that is to be resumed "
                    f"had read {self.consumed}; is it the same log?"
                )
        if last is not None and fingerprint(last) != self.last_event:
            raise StateError(
                f"{self.config.log}: event {self.consumed} is not what the run that is to be "
                "resumed had read; is it the same log?"
            )
        return events

    def _within(self, log: Iterable[E]) -> Iterator[E]:
        """The events from `start` to `end`. One wrong stamp does not end them."""
        start = -math.inf if self.config.start is None else self.config.start
        end = math.inf if self.config.end is None else self.config.end
        beyond = 0
        for event in log:
            if start <= event.t <= end:
                beyond = 0
                yield event
            elif event.t > end:
                beyond += 1
                if beyond == MOST_BEYOND:
                    return

    def _nothing(self) -> str:
        """Why there is no estimate, in words."""
        withheld = len(self.history.withheld)
        if withheld:
            return (
                f"the filter withheld its estimate at all {withheld} scans{self._between()}: it "
                "was never sure of one place; give it more of the log, or take a filter that tells "
                "several places (--filter mixture)"
            )
        ignored = ", ".join(f"{n} × {why}" for why, n in self.ignored.items()) or "nothing"
        return f"no usable scan{self._between()}; left out: {ignored}"

    def _between(self) -> str:
        """The part of the log that was asked for, in words."""
        start, end = self.config.start, self.config.end
        after = "" if start is None else f" from start = {start:.13g} s on"
        return after + ("" if end is None else f" up to end = {end:.13g} s")


def fingerprint(event: Event) -> str:
    """Tells one event from another."""
    told = hashlib.sha256(np.float64(event.t).tobytes())
    for array in arrays_of(event).values():
        told.update(array.tobytes())
    return told.hexdigest()


def _grid(config: RunConfig) -> OccupancyGrid:
    """The map; without one, the floor from which a landmark can be seen."""
    if config.map is not None:
        return OccupancyGrid.load(config.map)
    if is_mrclam(config.log):
        landmarks = Mrclam(config.log, config.robot).landmarks
        reach = float(config.settings["sightings"]["range_max"])
        return open_floor(landmarks.places, reach, landmarks.name)
    if "map" not in config.topics:
        raise ConfigError(
            f"{config.log}: is no MRCLAM folder, which has a map: which map? Give a file, or the "
            "topic of a bag that holds one"
        )
    return read_map(config.log, config.topic("map"))


def _truth(config: RunConfig) -> Trajectory | None:
    if "truth" in config.topics:
        return read_truth(config.log, config.topic("truth"))
    if config.truth is not None:
        return read_trajectory(config.truth)
    return Mrclam(config.log, config.robot).truth if is_mrclam(config.log) else None
