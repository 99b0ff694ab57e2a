"""A log, from its first event to its last, through the localizer that a config describes."""

import time
from collections import Counter
from collections.abc import Iterator
from itertools import dropwhile, takewhile

from mcloc.config import RunConfig
from mcloc.errors import LogError
from mcloc.events import Event
from mcloc.io.log import read_log
from mcloc.io.tum import read_trajectory
from mcloc.kernels.jit import set_threads
from mcloc.localizer import Estimate, Localizer
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.report.wheels import Wheels


class Run:
    """One run: iterate over it once to make it; what it finds stays in it, also when it breaks off.

    config: of the run, complete. grid, truth: as loaded. localizer: its state after the last
    estimate. estimates: one for each usable scan so far. wheels: odometry so far. wall_time:
    seconds of processing so far. Raises McLocError at once where the config, the map or the truth
    cannot be right, or the log cannot be opened; LogError in the middle of a log that is cut, or
    at the end of one without a usable scan.
    """

    def __init__(self, config: RunConfig) -> None:
        self.config = config.resolved()
        self.truth = None if config.truth is None else read_trajectory(config.truth)
        self.grid = OccupancyGrid.load(config.map)
        self.log = read_log(config.log, config.mount)
        if config.threads is not None:
            set_threads(config.threads)
        self.localizer = Localizer(
            self.grid,
            self.config.composition,
            seed=self.config.seed,
            initial=config.initial,
            initial_sigma=config.initial_sigma,
            policy=self.config.policy,
        )
        self.estimates: list[Estimate] = []
        self.wheels = Wheels()
        self.wall_time = 0.0

    def __iter__(self) -> Iterator[Estimate]:
        began = time.perf_counter()
        for estimate in self.localizer.run(self.wheels.watch(self._events())):
            self.estimates.append(estimate)
            self.wall_time = time.perf_counter() - began
            yield estimate
        if not self.estimates:
            ignored = ", ".join(f"{n} × {why}" for why, n in self.ignored.items()) or "nothing"
            raise LogError(
                f"{self.config.log}: no usable scan{self._between()}; left out: {ignored}"
            )

    @property
    def ignored(self) -> Counter[str]:
        """How many events were left out, by reason."""
        return self.localizer.ignored + Counter(self.log.skipped)

    def _events(self) -> Iterator[Event]:
        """From the first event at or after `start` to the last one before any after `end`."""
        start, end = self.config.start, self.config.end
        events = iter(self.log)
        if start is not None:
            events = dropwhile(lambda event: event.t < start, events)
        if end is not None:
            events = takewhile(lambda event: event.t <= end, events)
        return events

    def _between(self) -> str:
        """The part of the log that was asked for, in words."""
        start, end = self.config.start, self.config.end
        after = "" if start is None else f" from start = {start:g} s on"
        return after + ("" if end is None else f" up to end = {end:g} s")
