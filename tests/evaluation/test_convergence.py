"""Converged: error < 0.5 m and < 10° from some moment on for at least 3 m and 5 references."""

import numpy as np
import pytest

from mcloc.evaluation import Accuracy, Recovery, evaluate
from mcloc.evaluation.convergence import found
from mcloc.evaluation.errors import pose_errors
from mcloc.evaluation.kidnapping import Kidnapping
from mcloc.trajectory import Trajectory

GOOD, FAR, TURNED = (0.4, np.radians(9.0)), (0.6, 0.0), (0.0, np.radians(11.0))


def accuracy(
    errors: list[tuple[float, float]],
    step: float = 0.75,
    kidnappings: tuple[float, ...] = (),
    jumps: dict[int, float] | None = None,
) -> Accuracy:
    """A drive along x, `step` metres every 2 s, with these errors (sideways m, heading rad)."""
    n = len(errors)
    t = 10.0 + 2.0 * np.arange(n)
    x = step * np.arange(n)
    for index, distance in (jumps or {}).items():
        x[index:] += distance
    reference = np.column_stack([x, np.zeros((n, 2))])
    estimate = reference + np.array([(0.0, *e) for e in errors])
    wheels = np.column_stack([step * np.arange(n), np.zeros((n, 2))])
    return evaluate(
        Trajectory(t, estimate),
        Trajectory(t, reference),
        odometry=Trajectory(t, wheels) if jumps else None,
        kidnappings=kidnappings,
    )


def converged(a: Accuracy) -> tuple[bool, float | None, float | None]:
    return a.converged, a.time_to_converge_s, a.distance_to_converge_m


def test_time_and_distance_count_from_the_start_to_the_first_good_reference() -> None:
    assert converged(accuracy([FAR, TURNED, FAR] + [GOOD] * 5)) == (True, 6.0, 2.25)


def test_good_from_the_start_takes_no_time() -> None:
    assert converged(accuracy([GOOD] * 5)) == (True, 0.0, 0.0)


def test_four_references_are_too_few_however_far_they_lie_apart() -> None:
    assert converged(accuracy([FAR] + [GOOD] * 4, step=2.0)) == (False, None, None)
    assert converged(accuracy([FAR] + [GOOD] * 5, step=2.0)) == (True, 2.0, 2.0)


def test_less_than_three_metres_are_too_short_however_many_references_there_are() -> None:
    assert converged(accuracy([FAR] + [GOOD] * 30, step=0.1)) == (False, None, None)
    assert converged(accuracy([FAR] + [GOOD] * 31, step=0.1)) == (True, 2.0, pytest.approx(0.1))


def test_three_metres_are_enough_though_their_sum_is_rounded_down() -> None:
    assert converged(accuracy([FAR] * 2 + [GOOD] * 11, step=0.3)) == (True, 4.0, 0.6)


@pytest.mark.parametrize("bad", [FAR, TURNED, (0.5, 0.0)])
def test_an_error_at_the_end_undoes_it(bad: tuple[float, float]) -> None:
    assert converged(accuracy([GOOD] * 20 + [bad])) == (False, None, None)


def test_it_counts_from_the_last_moment_that_was_bad() -> None:
    assert converged(accuracy([GOOD] * 6 + [FAR] + [GOOD] * 5)) == (True, 14.0, 5.25)


def test_each_kidnapping_has_its_own_recovery_and_the_last_one_speaks_for_the_run() -> None:
    # Kidnapped at 14 s and at 29 s, that is before the references 2 (14 s) and 10 (30 s).
    errors = [GOOD] * 2 + [FAR] * 2 + [GOOD] * 6 + [TURNED] + [GOOD] * 3
    a = accuracy(errors, kidnappings=(29.0, 14.0))
    assert a.recoveries == (
        Recovery(14.0, recovered=True, path_m=5.25, after_s=4.0, after_m=1.5),
        Recovery(29.0, recovered=False, path_m=2.25),
    )
    assert converged(a) == (False, None, None)


def test_time_counts_from_a_kidnapping_between_references_and_distance_from_the_next_one() -> None:
    a = accuracy([GOOD] * 5 + [FAR] + [GOOD] * 5, kidnappings=(19.5,))
    assert a.recoveries == (Recovery(19.5, recovered=True, path_m=3.75, after_s=2.5, after_m=0.75),)
    assert converged(a) == (True, 2.5, 0.75)


def test_a_recovery_never_takes_less_than_no_time() -> None:
    # A reference within a millisecond of a stamp is at that stamp.
    a = accuracy([GOOD] * 10, kidnappings=(14.0005,))
    assert a.recoveries == (
        Recovery(14.0005, recovered=True, path_m=5.25, after_s=0.0, after_m=0.0),
    )


def test_the_way_of_the_kidnapping_itself_is_no_path() -> None:
    # Good before and after, each stretch shorter than 3 m: the jump of 8 m must not fill it up.
    a = accuracy([GOOD] * 4 + [GOOD] * 6, step=0.5, jumps={4: 8.0})
    assert a.recoveries == (Recovery(18.0, recovered=False, path_m=2.5),)
    long_enough = accuracy([GOOD] * 4 + [GOOD] * 7, step=0.5, jumps={4: 8.0})
    assert long_enough.recoveries == (
        Recovery(18.0, recovered=True, path_m=3.0, after_s=0.0, after_m=0.0),
    )


def test_two_kidnappings_between_the_same_references_leave_the_first_no_stretch() -> None:
    a = accuracy([GOOD] * 10, kidnappings=(13.0, 13.5))
    assert [(r.recovered, r.path_m) for r in a.recoveries] == [(False, 0.0), (True, 5.25)]


def test_the_path_of_a_stretch_ends_where_the_next_kidnapping_begins() -> None:
    # References 0 to 3, 4 to 9 and 10 to 12; the ways of 8 m and 5 m between them are no path.
    a = accuracy([GOOD] * 13, step=0.5, jumps={4: 8.0, 10: 5.0})
    assert [r.path_m for r in a.recoveries] == [2.5, 1.0]


# Scans for which no pose was told


def withholding(told: slice, scans: tuple[int, int] | None, n: int = 12) -> Accuracy:
    """A drive along x, 0.75 m every 2 s from 10 s on, with good estimates at some references only.
    scans: which references the first and the last scan were at.
    """
    t = 10.0 + 2.0 * np.arange(n)
    reference = np.column_stack([0.75 * np.arange(n), np.zeros((n, 2))])
    ends = None if scans is None else (float(t[scans[0]]), float(t[scans[1]]))
    estimate = Trajectory(t[told], reference[told])
    return evaluate(estimate, Trajectory(t, reference), kidnappings=(25.0,), scans=ends)


def test_time_counts_from_the_first_scan_though_no_pose_was_told() -> None:
    """Kidnapped at 25 s, before the reference at 26 s, while nothing is told before 30 s."""
    a = withholding(slice(10, 20), (0, 19), n=20)
    assert a.recoveries == (Recovery(25.0, recovered=True, path_m=8.25, after_s=5.0, after_m=1.5),)
    assert converged(a) == (True, 5.0, 1.5)
    assert a.position_max_m == 0.0
    # Who does not know of the scans sees neither the kidnapping nor the search.
    a = withholding(slice(10, 20), None, n=20)
    assert (converged(a), a.recoveries) == ((True, 0.0, 0.0), ())


def test_who_tells_no_pose_at_the_end_is_not_localized() -> None:
    a = withholding(slice(0, 7), (0, 11))
    assert a.recoveries == (Recovery(25.0, recovered=False, path_m=2.25),)
    assert converged(a) == (False, None, None)
    assert a.position_max_m == 0.0


def test_scans_that_all_have_a_pose_change_nothing() -> None:
    """Nor do references beyond the scans."""
    assert withholding(slice(2, 12), (2, 11)) == withholding(slice(2, 12), None)


# Found, whatever comes later


def found_after(errors: list[tuple[float, float]], kidnapped: list[int]) -> list[float | None]:
    """Metres, for the start and each kidnapping; a reference each 0.75 m and 2 s."""
    t = 10.0 + 2.0 * np.arange(len(errors))
    truth = np.column_stack([0.75 * np.arange(len(errors)), np.zeros((len(errors), 2))])
    estimate = Trajectory(t, truth + np.array([(0.0, *e) for e in errors]))
    compared = pose_errors(estimate, Trajectory(t, truth))
    listed = [Kidnapping(float(t[k]), k) for k in kidnapped]
    return [r.after_m if r.recovered else None for r in found(compared, listed)]


def test_found_is_what_stays_good_for_3_m_whatever_comes_later() -> None:
    assert found_after([FAR] + [GOOD] * 5 + [FAR] * 3, []) == [0.75]
    assert found_after([FAR] + [GOOD] * 4 + [FAR] + [GOOD] * 5, []) == [4.5]
    assert found_after([GOOD] * 4 + [FAR], []) == [None]


def test_how_long_it_has_been_localized_since_it_was_found() -> None:
    """References are 2 s apart, and the last one carries no time: 10 s of 14 s at first."""
    errors = [FAR] + [GOOD] * 5 + [TURNED, FAR, FAR]
    a = accuracy(errors)
    assert (a.converged, a.time_to_find_s, a.distance_to_find_m) == (False, 2.0, 0.75)
    assert a.localized_fraction == pytest.approx(5.0 / 7.0)
    a = accuracy([FAR] + [GOOD] * 5 + [FAR] + [GOOD] * 5)
    assert (a.time_to_find_s, a.time_to_converge_s) == (2.0, 14.0)
    assert a.localized_fraction == pytest.approx(9.0 / 10.0)
    assert accuracy([FAR] + [GOOD] * 5).localized_fraction == 1.0
    a = accuracy([FAR] * 6 + [GOOD] * 3 + [FAR])
    assert (a.time_to_find_s, a.distance_to_find_m, a.localized_fraction) == (None, None, None)
    # Of the last stretch alone: the first one ends badly, in the last one it is found 2 s after it.
    a = accuracy([GOOD] * 6 + [FAR] * 2 + [GOOD] * 6, kidnappings=(23.0,))
    assert (a.time_to_find_s, a.localized_fraction) == (pytest.approx(3.0), 1.0)


def test_each_kidnapping_is_judged_up_to_the_next_one() -> None:
    errors = [GOOD] * 6 + [FAR] * 2 + [GOOD] * 5 + [FAR] + [GOOD] * 3
    assert found_after(errors, [6, 13]) == [0.0, 1.5, None]
