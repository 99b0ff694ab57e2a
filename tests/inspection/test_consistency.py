"""Scans against odometry: each fault, planted in drives, is found and named, and no other one."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from mcloc.events import Event, Odometry, Scan
from mcloc.geometry import Pose, compose, wrap
from mcloc.inspection import LogInspection
from mcloc.inspection.consistency import compare
from mcloc.inspection.faults import DEGREES, MIRRORED, NONE, SIGN, STILL, TURNED, Fault
from mcloc.inspection.scan_pairs import Pair
from mcloc.simulation import SimulatedDrive

Inspect = Callable[[Iterable[Event]], LogInspection]
Recorded = Callable[[str], tuple[Event, ...]]
Simulated = Callable[[int], SimulatedDrive]
Planted = Callable[[Iterable[Event]], Iterator[Event]]


def in_scans(change: Callable[[Scan], Scan]) -> Planted:
    def plant(events: Iterable[Event]) -> Iterator[Event]:
        for event in events:
            yield change(event) if isinstance(event, Scan) else event

    return plant


def in_odometry(change: Callable[[Pose], Pose]) -> Planted:
    def plant(events: Iterable[Event]) -> Iterator[Event]:
        for event in events:
            if isinstance(event, Odometry):
                yield replace(event, pose=change(event.pose))
            elif event.odometry is None:
                yield event
            else:
                yield replace(event, odometry=change(event.odometry))

    return plant


def odometry_times(factors: ArrayLike) -> Planted:
    return in_odometry(lambda pose: pose * np.asarray(factors))


def stated_yaw(degrees: float) -> Planted:
    """The mount is stated to look this much farther to the left than it does."""
    turn = np.array([0.0, 0.0, np.radians(degrees)])
    return in_scans(lambda scan: replace(scan, mount=scan.mount + turn))


def reversed_beams(scan: Scan) -> Scan:
    return replace(scan, ranges=scan.ranges[::-1].copy())


# By what is wrong: the check that must find it, what it must be about (None: the laser), the words
# that its remedy must hold.
SINGLE: dict[str, tuple[Planted, str, str | None, str]] = {
    "millimetres": (odometry_times([1e3, 1e3, 1]), "odometry-unit", "odometry", "0.001"),
    "centimetres": (odometry_times([1e2, 1e2, 1]), "odometry-unit", "odometry", "0.01"),
    "hectometres": (odometry_times([1e-2, 1e-2, 1]), "odometry-unit", "odometry", "100"),
    "kilometres": (odometry_times([1e-3, 1e-3, 1]), "odometry-unit", "odometry", "1000"),
    "degrees": (
        in_odometry(lambda p: np.array([p[0], p[1], np.degrees(wrap(p[2]))])),
        "odometry-unit",
        "odometry",
        "π/180",
    ),
    "turn sign": (odometry_times([1, 1, -1]), "odometry-turn-sign", "odometry", "negate θ"),
    "backwards": (odometry_times([-1, -1, 1]), "odometry-reversed", "odometry", "negate x and y"),
    "mirrored odometry": (odometry_times([1, -1, -1]), "laser-mirrored", None, "negate y and θ"),
    "mirrored laser": (in_scans(reversed_beams), "laser-mirrored", None, "reverse the order"),
    "yaw 90": (stated_yaw(-90), "laser-yaw", None, ",0 (m, m, degrees)"),
    "yaw 180": (stated_yaw(-180), "laser-yaw", None, ",0 (m, m, degrees)"),
    "yaw 270": (stated_yaw(90), "laser-yaw", None, ",0 (m, m, degrees)"),
    "mirrored, yaw 180": (
        lambda events: stated_yaw(-180)(in_scans(reversed_beams)(events)),
        "laser-mirrored",
        None,
        ",0 (m, m, degrees)",
    ),
}

# intel's scans lie a metre apart, in corridors: whether the robot moved hardly shows.
TOO_SPARSE = [("intel/intel_test0", "kilometres"), ("intel/intel_test0", "hectometres")]
RECORDED = [
    pytest.param(log, fault, marks=() if log == "wean/robotdata4" else pytest.mark.slow)
    for log in ("wean/robotdata4", "malaga/scans", "intel/intel_test0", "fhw/fhw_test0")
    for fault in SINGLE
    if (log, fault) not in TOO_SPARSE
]


def assert_found(inspect: Inspect, events: Iterable[Event], fault: str) -> None:
    plant, check, about, remedy = SINGLE[fault]
    log = inspect(plant(events))
    (finding,) = log.findings()
    assert finding.check == check
    assert finding.about == (about or next(iter(log.lasers)))
    assert remedy in finding.remedy


@pytest.mark.parametrize("fault", SINGLE)
@pytest.mark.parametrize("seed", [1, 2])
def test_planted_in_a_simulated_drive(
    inspect: Inspect, simulated: Simulated, fault: str, seed: int
) -> None:
    assert_found(inspect, simulated(seed).events, fault)


@pytest.mark.parametrize(("name", "fault"), RECORDED)
def test_planted_in_a_recorded_log(
    inspect: Inspect, recorded: Recorded, name: str, fault: str
) -> None:
    assert_found(inspect, recorded(name), fault)


@pytest.mark.parametrize("seed", range(12))
def test_a_right_drive_has_no_fault(inspect: Inspect, simulated: Simulated, seed: int) -> None:
    assert inspect(simulated(seed).events).findings() == []


def test_scans_without_odometry_of_their_own(inspect: Inspect, simulated: Simulated) -> None:
    bare = list(in_scans(lambda scan: replace(scan, odometry=None))(simulated(1).events))
    log = inspect(bare)
    assert log.findings() == []
    assert log.path.length == pytest.approx(25.0, rel=0.1)
    assert_found(inspect, bare, "yaw 90")
    assert_found(inspect, bare, "turn sign")


def test_the_mount_to_give_is_told(inspect: Inspect, simulated: Simulated) -> None:
    (finding,) = inspect(stated_yaw(90)(simulated(1).events)).findings()
    scan = next(event for event in simulated(1).events if isinstance(event, Scan))
    x, y, _ = scan.mount
    assert f"--mount {x:g},{y:g},0 " in finding.remedy


def test_the_fault_of_one_laser_of_two(inspect: Inspect, simulated: Simulated) -> None:
    second = in_scans(lambda scan: replace(scan, source="second", t=scan.t + 1e-3))

    def both(first: Iterable[Event], plant: str) -> Iterator[Event]:
        for event in first:
            yield event
            if isinstance(event, Scan):
                yield from SINGLE[plant][0](second([event]))

    found = inspect(both(simulated(1).events, "yaw 180")).findings()
    assert [(f.check, f.about) for f in found] == [("laser-yaw", "second")]
    wheels = SINGLE["turn sign"][0](simulated(1).events)
    found = inspect(both(wheels, "yaw 180")).findings()
    assert ("odometry-turn-sign", "odometry") in [(f.check, f.about) for f in found]
    assert len({(f.check, f.about) for f in found}) == len(found)


def test_odometry_of_another_drive_contradicts(inspect: Inspect, simulated: Simulated) -> None:
    other = iter([e.odometry for e in simulated(2).events if isinstance(e, Scan)])

    def exchanged() -> Iterator[Event]:
        for event in simulated(1).events:
            if isinstance(event, Odometry):
                continue
            pose = next(other, None)
            if pose is None:
                return
            yield replace(event, odometry=pose)

    (finding,) = inspect(exchanged()).findings()
    assert finding.check == "odometry-contradicts"


def test_a_log_without_odometry_or_moves_says_nothing(
    inspect: Inspect, simulated: Simulated
) -> None:
    scans = [replace(e, odometry=None) for e in simulated(1).events if isinstance(e, Scan)]
    log = inspect(scans)
    assert log.findings() == []
    assert log.path.count == 0
    assert len(log.open_faults()) == len((*TURNED, *MIRRORED))
    still = [replace(scan, odometry=np.zeros(3)) for scan in scans]
    assert inspect(still).findings() == []


@pytest.mark.parametrize(
    "fault", [NONE, *TURNED, *MIRRORED, SIGN, DEGREES, Fault("mm", length=1e-3)]
)
def test_motion_against_matrices(fault: Fault) -> None:
    """M⁻¹ T(a)⁻¹ T(b) M as 3 × 3 matrices, between reflections F where beams are mirrored."""
    rng = np.random.default_rng(3)
    a, b, mount = rng.normal(size=(3, 3))

    def matrix(pose: np.ndarray) -> np.ndarray:
        c, s = np.cos(pose[2]), np.sin(pose[2])
        return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])

    scale = np.array([fault.length, fault.length, fault.turn * fault.angle])
    at = matrix(mount + np.array([0.0, 0.0, fault.yaw]))
    moved = np.linalg.inv(at) @ np.linalg.inv(matrix(scale * a)) @ matrix(scale * b) @ at
    flip = np.diag([1.0, -1.0 if fault.mirrored else 1.0, 1.0])
    np.testing.assert_allclose(matrix(fault.motion(a, b, mount)), flip @ moved @ flip, atol=1e-12)


def test_residuals_against_all_distances() -> None:
    rng = np.random.default_rng(4)
    a, b, mount = np.array([[1.0, 2.0, 0.3], [1.4, 2.2, 0.5], [0.2, 0.1, 0.0]])
    earlier, later = rng.uniform(-3.0, 3.0, (40, 2)), rng.uniform(-3.0, 3.0, (70, 2))
    residuals, apart = Pair(earlier, later, a, b, mount).residuals((NONE, STILL))

    # The earlier points in the odometry frame, seen from the later pose of the laser.
    world = compose(compose(a, mount), np.column_stack([earlier, np.zeros(40)]))[:, :2]
    x, y, heading = compose(b, mount)
    c, s = np.cos(heading), np.sin(heading)
    moved = (world - (x, y)) @ np.array([[c, -s], [s, c]])
    for points, residual in ((moved, residuals[0]), (earlier, residuals[1])):
        nearest = np.minimum(cdist(points, later).min(axis=1), 0.5)
        assert residual == pytest.approx(nearest.mean())
    assert apart == pytest.approx([0.0, np.linalg.norm(moved - earlier, axis=1).mean()])


def test_a_motion_that_was_made_leaves_nothing() -> None:
    points = np.random.default_rng(5).uniform(-3.0, 3.0, (60, 2))
    a, b = np.zeros(3), np.array([0.5, 0.0, 0.2])
    c, s = np.cos(0.2), np.sin(0.2)
    later = (points - (0.5, 0.0)) @ np.array([[c, -s], [s, c]])
    pairs = [Pair(points, later, a, b, np.zeros(3))] * 12
    (turned,) = compare(pairs, (TURNED[1],))
    assert turned.stated == pytest.approx(0.0, abs=1e-12)
    assert turned.pairs == 12
    assert turned.rejected
    assert not turned.believed
