"""Which estimate a reference is compared with, and what share of time it speaks of."""

import numpy as np
import pytest

from mcloc.errors import TruthError
from mcloc.evaluation import evaluate
from mcloc.evaluation.errors import pose_errors
from mcloc.trajectory import Trajectory


def path(t: list[float], poses: list[tuple[float, float, float]]) -> Trajectory:
    return Trajectory(np.array(t), np.array(poses, dtype=np.float64))


def line(t: list[float], y: float = 0.0, speed: float = 1.0) -> Trajectory:
    """Along x with `speed` m/s, `y` beside the axis."""
    return path(t, [(speed * s, y, 0.0) for s in t])


def test_errors_are_taken_without_alignment() -> None:
    t = [0.0, 1.0, 2.0]
    accuracy = evaluate(line(t, y=0.3), line(t))
    assert accuracy.position_median_m == pytest.approx(0.3)
    assert accuracy.position_max_m == pytest.approx(0.3)


def test_the_heading_error_goes_the_short_way_round() -> None:
    estimate = path([0.0, 1.0], [(0, 0, np.radians(179)), (0, 0, np.radians(-170))])
    reference = path([0.0, 1.0], [(0, 0, np.radians(-179)), (0, 0, np.radians(170))])
    heading = np.degrees(pose_errors(estimate, reference).heading)
    assert heading == pytest.approx([2.0, 20.0])


def test_between_estimates_of_one_hypothesis_the_estimate_is_interpolated() -> None:
    estimate = path([0.0, 2.0], [(0, 0, 3.0), (2, 0, -3.0)])
    reference = path([0.0, 0.5, 2.0], [(0, 0, 3.0), (0.5, 0.0, 3.0), (2, 0, -3.0)])
    errors = pose_errors(estimate, reference)
    assert errors.position == pytest.approx([0.0, 0.0, 0.0])
    quarter = (2 * np.pi - 6.0) / 4.0
    assert errors.difference[1, 2] == pytest.approx(quarter)


@pytest.mark.parametrize("jump", [(0.0, 1.1, 0.0), (0.0, 0.0, np.radians(46))])
def test_the_earlier_hypothesis_stands_until_the_next_one_is_made(
    jump: tuple[float, float, float],
) -> None:
    reference = line([0.0, 0.5, 1.0])
    wrong = path([0.0, 1.0], [jump, (1, 0, 0)])
    errors = pose_errors(wrong, reference)
    assert errors.difference[:, 1] == pytest.approx([jump[1], jump[1], 0.0])
    assert errors.difference[:, 2] == pytest.approx([jump[2], jump[2], 0.0])
    assert errors.difference[:, 0] == pytest.approx([0.0, -0.5, 0.0])


def test_sparse_estimates_that_move_with_the_truth_are_no_jump() -> None:
    estimate = line([0.0, 10.0], y=0.2)
    reference = line([0.0, 2.5, 5.0, 10.0])
    assert pose_errors(estimate, reference).position == pytest.approx([0.2] * 4)


def test_a_reference_within_a_millisecond_meets_the_estimate_itself() -> None:
    reference = path([0.9991, 2.0009], [(5, 0, 0), (9, 0, 0)])
    estimate = path([1.0, 1.5, 2.0], [(5, 0, 0), (7, 1, 1), (9, 0, 0)])
    assert pose_errors(estimate, reference).position == pytest.approx([0.0, 0.0], abs=1e-12)


def test_references_that_the_estimate_does_not_cover_are_left_out() -> None:
    reference = line([0.0, 1.0, 2.0, 3.0, 4.0])
    errors = pose_errors(line([0.5, 3.5]), reference)
    assert errors.t.tolist() == [1.0, 2.0, 3.0]


def test_a_single_estimate_covers_its_own_moment() -> None:
    errors = pose_errors(line([2.0], y=1.0), line([1.0, 2.0, 3.0]))
    assert errors.t.tolist() == [2.0]
    assert errors.position == pytest.approx([1.0])
    assert errors.lost_fraction(0.5) == 1.0


def test_time_is_counted_to_the_next_reference_and_at_most_five_seconds() -> None:
    # 1 s at 0 m, 5 of 100 s at 0.6 m, 2 s at 1.5 m, 4 s at 3 m: 12 s; the last one carries none.
    t = [0.0, 1.0, 101.0, 103.0, 107.0]
    offset = [0.0, 0.6, 1.5, 3.0, 9.0]
    reference = path(t, [(0, 0, 0)] * 5)
    estimate = path(t, [(0, y, 0) for y in offset])
    lost = evaluate(estimate, reference).lost_fraction
    assert lost == pytest.approx({"0.5": 11 / 12, "1": 6 / 12, "2": 4 / 12})


def test_an_error_at_the_limit_is_not_above_it() -> None:
    t = [0.0, 1.0, 2.0]
    lost = evaluate(line(t, y=1.0), line(t)).lost_fraction
    assert lost == {"0.5": 1.0, "1": 0.0, "2": 0.0}


def test_trajectories_of_other_times_are_refused_with_both_spans() -> None:
    with pytest.raises(TruthError, match=r"0\.000 … 1\.000 s .*50\.000 … 60\.000 s"):
        evaluate(line([0.0, 1.0]), line([50.0, 60.0]))


def test_empty_and_non_finite_trajectories_are_refused() -> None:
    empty = Trajectory(np.empty(0), np.empty((0, 3)))
    with pytest.raises(TruthError, match="estimate holds no poses"):
        evaluate(empty, line([0.0]))
    with pytest.raises(TruthError, match="reference holds no poses"):
        evaluate(line([0.0]), empty)
    with pytest.raises(TruthError, match="not finite"):
        evaluate(line([0.0]), path([0.0], [(np.nan, 0, 0)]))


def test_covariance_and_share_belong_to_the_estimate_that_is_compared() -> None:
    t = np.array([0.0, 1.0])
    covariances = np.stack([np.eye(3), 3.0 * np.eye(3)])
    poses = np.array([[0.0, 0, 0], [1, 0, 0]])
    estimate = Trajectory(t, poses, covariances, share=np.array([0.8, 1.0]))
    errors = pose_errors(estimate, line([0.0005, 0.25, 1.0]))
    assert errors.share == pytest.approx([0.8, 0.85, 1.0])
    assert errors.covariances is not None
    assert errors.covariances[:, 0, 0] == pytest.approx([1.0, 1.5, 3.0])
