"""Drives to inspect, simulated and recorded, and inspections of them."""

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

import pytest

from mcloc.events import Event
from mcloc.inspection import LogInspection
from mcloc.io.log import read_log
from mcloc.simulation import SimulatedDrive, office_drive

Inspect = Callable[[Iterable[Event]], LogInspection]
Recorded = Callable[[str], tuple[Event, ...]]
Simulated = Callable[[int], SimulatedDrive]


@pytest.fixture(scope="session")
def inspect() -> Inspect:
    def inspected(events: Iterable[Event]) -> LogInspection:
        log = LogInspection()
        for _ in log.watch(events):
            pass
        return log

    return inspected


@pytest.fixture(scope="session")
def simulated() -> Simulated:
    """A drive of 25 m by its seed."""
    return cache(lambda seed: office_drive(seed, 25.0))


@pytest.fixture(scope="session")
def recorded(data_dir: Path) -> Recorded:
    """The events of a recorded log by its name."""
    return cache(lambda name: tuple(read_log(data_dir / f"{name}.log.gz")))
