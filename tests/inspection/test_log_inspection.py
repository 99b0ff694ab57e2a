"""What is told of a log, whatever is in it."""

import json
from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mcloc.events import UNKNOWN, Event, Odometry, Scan, Sightings
from mcloc.inspection import LogInspection, describe_log
from mcloc.simulation import SimulatedDrive

Inspect = Callable[[Iterable[Event]], LogInspection]
Simulated = Callable[[int], SimulatedDrive]

anything = st.floats(allow_nan=False, allow_infinity=False)
poses = st.tuples(anything, anything, anything).map(np.array)
readings = st.lists(st.floats(), min_size=12, max_size=12).map(np.array)
scans = st.builds(
    Scan,
    t=anything,
    ranges=readings,
    angles=st.just(np.linspace(-1.0, 1.0, 12)),
    range_max=st.floats(min_value=0.0, exclude_min=True),
    mount=poses,
    odometry=st.none() | poses,
    source=st.sampled_from(["front", "rear"]),
)
sightings = st.builds(
    Sightings,
    t=anything,
    landmark=st.just(np.array([0, UNKNOWN])),
    range=st.lists(st.floats(), min_size=2, max_size=2).map(np.array),
    bearing=st.just(np.array([0.0, np.nan])),
    mount=poses,
)
wheeled = st.builds(Odometry, t=anything, pose=poses)
events = st.lists(scans | sightings | wheeled, min_size=1, max_size=30)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(log=events)
def test_nothing_in_a_damaged_log_breaks_it(inspect: Inspect, log: list[Event]) -> None:
    found = inspect(log)
    found.findings()
    json.dumps(describe_log(found, ["door"]), allow_nan=False)


def test_numbers_of_a_drive(inspect: Inspect, simulated: Simulated) -> None:
    drive = simulated(1)
    told = describe_log(inspect(drive.events))
    assert told["start_s"] == drive.events[0].t
    assert told["end_s"] == drive.events[-1].t
    assert told["distance_m"] == pytest.approx(drive.distance, rel=0.1)
    assert told["backward_m"] < 0.1
    wheels = [event for event in drive.events if isinstance(event, Odometry)]
    assert told["odometry"] == {
        "events": len(wheels),
        "rate_hz": pytest.approx(10.0),
        "longest_gap_s": pytest.approx(max(b.t - a.t for a, b in pairwise(wheels))),
    }
    (laser,) = told["lasers"].values()
    ranges = [e.ranges[e.returned] for e in drive.events if isinstance(e, Scan)]
    median = np.median(np.concatenate(ranges))
    assert laser["range_median_m"] == pytest.approx(median, rel=0.024)


def test_the_same_is_told_of_any_number_of_events(inspect: Inspect, simulated: Simulated) -> None:
    """What is kept does not grow with the log: a drive there and there and there again."""
    drive = simulated(2)
    end = drive.events[-1].t + 0.1
    often = [replace(e, t=e.t + k * end) for k in range(4) for e in drive.events]
    log = inspect(often)
    assert log.findings() == []
    assert len(log.windows.chosen) <= 4
    assert describe_log(log)["odometry"]["rate_hz"] == pytest.approx(10.0, rel=0.01)


def seen(t: float, *of: tuple[int, float]) -> Sightings:
    landmark, ranges = np.array(of).T
    return Sightings(t, landmark.astype(np.intp), ranges, np.zeros(len(of)))


def wheels(n: int) -> list[Event]:
    return [Odometry(0.1 * k, np.array([0.01 * k, 0.0, 0.0])) for k in range(n)]


def test_what_a_robot_saw_of_landmarks(inspect: Inspect) -> None:
    """A long time without any is usual."""
    sightings = [
        seen(0.5, (0, 2.0), (2, 2.0)),
        seen(0.7, (2, np.nan), (UNKNOWN, 2.0)),
        *(seen(45.0 + 0.1 * k, (2, 2.0)) for k in range(20)),
    ]
    log = inspect([*wheels(500), *sightings])
    assert describe_log(log, ["door", "pillar", "lamp"])["sightings"] == {
        "events": 22,
        "rate_hz": pytest.approx(21 / 46.4),
        "longest_gap_s": pytest.approx(44.3),
        "sightings": 23,
        "of_landmark": {"door": 1, "pillar": 0, "lamp": 22},
        "range_median_m": pytest.approx(2.0, rel=0.024),
    }
    assert log.findings() == []
    assert describe_log(log)["sightings"] is None


def test_sightings_by_another_clock_or_out_of_order_are_found(inspect: Inspect) -> None:
    later = [seen(1000.0 + 0.1 * k, (0, 2.0)) for k in range(30)]
    (finding,) = inspect([*wheels(500), *later]).findings()
    assert (finding.check, finding.about) == ("clocks-apart", "sightings")
    mixed = [seen(10.0 + 0.1 * (k ^ 1), (0, 2.0)) for k in range(30)]
    (finding,) = inspect([*wheels(500), *mixed]).findings()
    assert (finding.check, finding.about) == ("stamps-reordered", "sightings")
