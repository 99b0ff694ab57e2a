"""A kidnapping is a jump of the truth that odometry does not explain."""

import numpy as np
import pytest

from mcloc.evaluation.kidnapping import find_kidnappings
from mcloc.geometry import Poses, between, compose
from mcloc.trajectory import Trajectory


def drive(n: int, step: float = 0.3, turn: float = 0.05) -> Poses:
    poses = np.zeros((n, 3))
    for i in range(1, n):
        poses[i] = compose(poses[i - 1], [step, 0.0, turn])
    return poses


def carried_off(truth: Poses, first: int, by: tuple[float, float, float]) -> Poses:
    """The truth, from index `first` on displaced by a motion in the robot's frame."""
    moved = truth.copy()
    place = compose(truth[first - 1], by)
    moved[first:] = compose(place, between(truth[first - 1], truth[first:]))
    return moved


T = np.arange(20.0)
IN_ITS_OWN_FRAME = [7.0, -3.0, 2.0]


def odometry(poses: Poses, t: np.ndarray = T) -> Trajectory:
    return Trajectory(t, compose(IN_ITS_OWN_FRAME, poses))


@pytest.mark.parametrize(
    "by",
    [(1.1, 0.0, 0.0), (0.0, -1.1, 0.0), (-6.0, 2.0, 3.0), (0.0, 0.0, np.radians(46))],
)
def test_a_jump_that_the_wheels_do_not_report_is_found(by: tuple[float, float, float]) -> None:
    truth = drive(20, turn=0.0)
    found = find_kidnappings(T, carried_off(truth, 8, by), odometry(truth))
    assert [(k.t, k.first) for k in found] == [(8.0, 8)]


@pytest.mark.parametrize("by", [(0.9, 0.0, 0.0), (0.0, 0.0, np.radians(44))])
def test_a_smaller_correction_of_the_truth_is_none(by: tuple[float, float, float]) -> None:
    truth = drive(20, step=0.0, turn=0.0)
    assert find_kidnappings(T, carried_off(truth, 8, by), odometry(truth)) == []


def test_a_large_motion_that_the_wheels_report_is_none() -> None:
    truth = drive(20, step=1.4, turn=1.0)
    assert find_kidnappings(T, truth, odometry(truth)) == []


def test_wheels_that_jump_while_the_truth_stays_are_none() -> None:
    truth = drive(20)
    assert find_kidnappings(T, truth, odometry(carried_off(truth, 8, (5.0, 0.0, 3.0)))) == []


@pytest.mark.parametrize(
    ("step", "turn", "wheel_step", "wheel_turn"),
    [
        (0.1, 0.0, 0.1, np.radians(0.45)),  # 8 m straight on, 4.5° a metre too far: 2.5 m, 36°
        (0.15, 0.0, 0.15, np.radians(0.675)),  # 12 m: 54°
        (0.0, np.radians(6.75), 0.0, np.radians(7.35)),  # 540° on the spot, 9 % too far: 48°
    ],
)
def test_what_drift_explains_over_a_gap_in_the_references_is_none(
    step: float, turn: float, wheel_step: float, wheel_turn: float
) -> None:
    t, ends = np.arange(81.0), [0, 80]
    truth, wheels = drive(81, step, turn), drive(81, wheel_step, wheel_turn)
    off = between(wheels[80], truth[80])
    assert np.hypot(off[0], off[1]) > 1.0 or abs(off[2]) > np.radians(45)
    assert find_kidnappings(t[ends], truth[ends], odometry(wheels, t)) == []


def test_what_drift_cannot_explain_over_a_gap_is_found() -> None:
    # 8 m straight on may drift 3.6 m by the stated 10 % and 5° a metre.
    t, ends = np.arange(81.0), [0, 80]
    wheels = drive(81, step=0.1, turn=0.0)
    for aside, kidnapped in ((3.5, False), (3.7, True)):
        truth = carried_off(wheels, 40, (0.0, aside, 0.0))
        found = find_kidnappings(t[ends], truth[ends], odometry(wheels, t))
        assert bool(found) is kidnapped


def test_a_kidnapping_within_a_gap_of_the_references_is_found_if_the_robot_stood() -> None:
    truth = carried_off(drive(20, step=0.0, turn=0.0), 10, (3.0, 0.0, 0.0))
    ends = [0, 19]
    found = find_kidnappings(T[ends], truth[ends], odometry(drive(20, step=0.0, turn=0.0)))
    assert [(k.t, k.first) for k in found] == [(19.0, 1)]


def test_nothing_is_detected_where_there_is_no_odometry() -> None:
    truth = carried_off(drive(20), 8, (5.0, 0.0, 0.0))
    assert find_kidnappings(T, truth, None) == []
    later = Trajectory(T[8:], drive(20)[8:])
    assert find_kidnappings(T, truth, later) == []


def test_listed_kidnappings_need_no_jump_and_lie_before_the_reference_they_name() -> None:
    found = find_kidnappings(T, drive(20), None, listed=[12.0, 3.5])
    assert [(k.t, k.first) for k in found] == [(3.5, 4), (12.0, 12)]


def test_a_kidnapping_outside_the_references_is_left_out() -> None:
    assert find_kidnappings(T, drive(20), None, listed=[-0.5, 19.5]) == []


@pytest.mark.parametrize("listed", [7.0, 7.5, 8.0])
def test_a_listed_kidnapping_is_not_detected_again(listed: float) -> None:
    truth = drive(20)
    moved = carried_off(truth, 8, (5.0, 0.0, 0.0))
    found = find_kidnappings(T, moved, odometry(truth), listed=[listed])
    assert [(k.t, k.first) for k in found] == [(listed, 8)]
