"""What `evaluate` returns, and what holds for every pair of trajectories."""

import json
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcloc.evaluation import Accuracy, evaluate
from mcloc.geometry import compose, wrap
from mcloc.trajectory import Trajectory

KEYS = [
    "position_median_m",
    "position_rmse_m",
    "position_p95_m",
    "position_max_m",
    "heading_median_deg",
    "lost_fraction",
    "converged",
    "time_to_converge_s",
    "distance_to_converge_m",
    "time_to_find_s",
    "distance_to_find_m",
    "localized_fraction",
    "nees_median",
    "recoveries",
]


def random_walk(seed: int, n: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    poses = np.cumsum(rng.normal(0.0, [0.5, 0.5, 0.4], (n, 3)), axis=0)
    poses[:, 2] = wrap(poses[:, 2])
    return Trajectory(np.cumsum(rng.uniform(0.1, 7.0, n)), poses)


def estimate_of(reference: Trajectory, seed: int) -> Trajectory:
    """An estimate at stamps of its own, with errors that are small in the second half."""
    rng = np.random.default_rng(seed + 1)
    n = len(reference)
    spread = np.where(np.arange(n) < n / 2, 1.0, 0.05)[:, None]
    t = reference.t + rng.uniform(0.0, 0.09, n)
    poses = reference.at(t) + spread * rng.normal(0.0, [0.8, 0.8, 0.3], (n, 3))
    poses[:, 2] = wrap(poses[:, 2])
    half = rng.normal(size=(n, 3, 3))
    covariances = half @ half.transpose(0, 2, 1) + 0.01 * np.eye(3)
    return Trajectory(t, poses, covariances, rng.uniform(0.9, 1.0, n))


def moved(trajectory: Trajectory, frame: np.ndarray) -> Trajectory:
    """The same trajectory, told in another frame."""
    c, s = np.cos(frame[2]), np.sin(frame[2])
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    covariances = trajectory.covariances
    return Trajectory(
        trajectory.t,
        compose(frame, trajectory.poses),
        None if covariances is None else turn @ covariances @ turn.T,
        trajectory.share,
    )


def approximately(values: object) -> object:
    """The same tree with every float compared up to rounding."""
    if isinstance(values, dict):
        return {key: approximately(value) for key, value in values.items()}
    if isinstance(values, list):
        return [approximately(value) for value in values]
    return pytest.approx(values, rel=1e-6, abs=1e-6) if isinstance(values, float) else values


seeds = st.integers(0, 2**32 - 2)
sizes = st.integers(2, 60)
coordinate = st.floats(-100.0, 100.0)


@settings(max_examples=50, deadline=None)
@given(seeds, sizes, st.tuples(coordinate, coordinate, st.floats(-np.pi, np.pi)))
def test_the_frame_does_not_matter(seed: int, n: int, frame: tuple[float, float, float]) -> None:
    reference = random_walk(seed, n)
    estimate = estimate_of(reference, seed)
    middle = float(reference.t[n // 2])
    here = evaluate(estimate, reference, kidnappings=[middle])
    elsewhere = np.array(frame)
    there = evaluate(moved(estimate, elsewhere), moved(reference, elsewhere), kidnappings=[middle])
    assert there.to_dict() == approximately(here.to_dict())
    assert there.heading_rmse_deg == pytest.approx(here.heading_rmse_deg)
    assert there.heading_p95_deg == pytest.approx(here.heading_p95_deg)


@settings(max_examples=50, deadline=None)
@given(seeds, sizes)
def test_errors_are_ordered_and_shares_are_shares(seed: int, n: int) -> None:
    reference = random_walk(seed, n)
    a = evaluate(estimate_of(reference, seed), reference, odometry=reference)
    assert 0.0 <= a.position_median_m <= a.position_p95_m <= a.position_max_m
    assert 0.0 <= a.position_rmse_m <= a.position_max_m
    assert 0.0 <= a.heading_median_deg <= a.heading_p95_deg <= 180.0
    assert 1.0 >= a.lost_fraction["0.5"] >= a.lost_fraction["1"] >= a.lost_fraction["2"] >= 0.0
    assert a.recoveries == ()


@settings(max_examples=50, deadline=None)
@given(seeds)
def test_the_truth_is_without_error_and_converged_at_once(seed: int) -> None:
    reference = random_walk(seed, 60)
    a = evaluate(reference, reference, odometry=reference)
    assert a.position_max_m == 0.0
    assert a.heading_p95_deg == pytest.approx(0.0, abs=1e-12)
    assert a.lost_fraction == {"0.5": 0.0, "1": 0.0, "2": 0.0}
    assert (a.converged, a.time_to_converge_s, a.distance_to_converge_m) == (True, 0.0, 0.0)


def test_the_dictionary_has_the_keys_of_the_summary_and_is_strict_json() -> None:
    reference = random_walk(1, 40)
    middle = float(reference.t[20])
    values = evaluate(estimate_of(reference, 1), reference, kidnappings=[middle]).to_dict()
    assert list(values) == KEYS
    assert list(values["lost_fraction"]) == ["0.5", "1", "2"]
    assert [list(recovery) for recovery in values["recoveries"]] == [
        ["t", "recovered", "path_m", "after_s", "after_m"]
    ]
    assert json.loads(json.dumps(values, allow_nan=False)) == values


def test_what_the_dictionary_leaves_out_is_the_spread_of_the_heading_and_what_was_not_seen() -> (
    None
):
    left_out = {field.name for field in fields(Accuracy)} - set(KEYS)
    of_sightings = {"sighted", "position_median_sighted_m"}
    assert left_out == {"heading_rmse_deg", "heading_p95_deg", *of_sightings}


def test_what_is_unknown_is_none() -> None:
    still = Trajectory(np.array([0.0]), np.zeros((1, 3)))
    values = evaluate(still, still).to_dict()
    unknown = {key for key, value in values.items() if value is None}
    assert unknown == {
        *("time_to_converge_s", "distance_to_converge_m", "nees_median"),
        *("time_to_find_s", "distance_to_find_m", "localized_fraction"),
    }
    assert values["converged"] is False


def test_sighted_are_the_references_near_a_sighting() -> None:
    """1 m off but for the 10 s around each of two sightings; 5 s is near, to either side."""
    t = np.arange(0.0, 61.0)
    sightings = np.array([20.0, 22.0, 40.5])
    near = ((t >= 15.0) & (t <= 27.0)) | ((t >= 35.5) & (t <= 45.5))
    off = np.where(near, 0.25, 1.0)
    zero = np.zeros(61)
    truth = Trajectory(t, np.stack([0.1 * t, zero, zero], axis=-1))
    estimate = Trajectory(t, np.stack([0.1 * t, off, zero], axis=-1))
    found = evaluate(estimate, truth, sightings=sightings)
    assert found.sighted == near.sum() == 23
    assert found.position_median_sighted_m == pytest.approx(0.25)
    assert found.position_median_m == pytest.approx(1.0)
    assert list(found.to_dict()) == [*KEYS, "sighted", "position_median_sighted_m"]
    for none in (None, np.empty(0), np.array([1000.0])):
        without = evaluate(estimate, truth, sightings=none)
        assert without.sighted == 0
        assert without.position_median_sighted_m is None
        assert list(without.to_dict()) == KEYS
