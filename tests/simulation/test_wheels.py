"""How the simulated wheels err."""

from dataclasses import replace

import numpy as np
import pytest

from mcloc.errors import ConfigError
from mcloc.geometry import compose
from mcloc.simulation import Wheels, follow
from mcloc.simulation.wheels import SLIP

PERFECT = Wheels(scale=0.0, drift=0.0, sigma_distance=0.0, sigma_turn=0.0, sigma_drift=0.0)


def straight(metres: float, steps: int) -> np.ndarray:
    return np.column_stack([np.linspace(0.0, metres, steps + 1), np.zeros((steps + 1, 2))])


def test_perfect_wheels_report_the_drive_in_a_frame_of_their_own() -> None:
    truth = follow([[3.0, 1.0], [6.0, 1.0], [6.0, 4.0], [2.0, 3.0]], 0.5).poses
    odometry = PERFECT.measure(truth, np.random.default_rng(0))
    np.testing.assert_allclose(compose(truth[0], odometry), truth, atol=1e-9)


def test_biases_are_per_metre_and_per_radian() -> None:
    wheels = Wheels(0.02, 0.01, 0.0, 0.0, 0.0)
    odometry = wheels.measure(straight(1.0, 1), np.random.default_rng(0))
    np.testing.assert_allclose(odometry[-1], [1.02, 0.0, 0.01], atol=1e-12)
    turn = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(wheels.measure(turn, np.random.default_rng(0))[-1, 2], 1.02)


@pytest.mark.parametrize("steps", [2, 200])
def test_deviations_grow_with_the_root_of_the_distance_however_it_is_cut(steps: int) -> None:
    wheels = Wheels(0.0, 0.0, sigma_distance=0.03, sigma_turn=0.0, sigma_drift=0.02)
    rng = np.random.default_rng(1)
    n = 2000
    ends = np.array([wheels.measure(straight(4.0, steps), rng)[-1] for _ in range(n)])
    five_sigma = 5.0 / np.sqrt(2 * n)  # relative, of a standard deviation from n samples
    assert ends[:, 2].std() == pytest.approx(0.02 * 2.0, rel=five_sigma)
    # What the heading's error costs in x is of second order: 4 m · 0.04² / 4 < 2 mm.
    assert ends[:, 0].std() == pytest.approx(0.03 * 2.0, rel=five_sigma, abs=0.002)


def test_as_much_of_the_way_slips_as_it_says_and_as_far() -> None:
    share, sigma = 0.2, 0.4
    wheels = replace(PERFECT, slip=share, sigma_slip=sigma, sigma_slip_turn=0.0)
    n = 5000  # stretches, of ten steps each
    odometry = wheels.measure(straight(n * SLIP, 10 * n), np.random.default_rng(3))
    excess = np.diff(odometry[:, 0]) / (SLIP / 10) - 1.0
    stretches = excess[5::10]  # in the middle of each
    slipped = np.abs(stretches) > 1e-6
    assert slipped.mean() == pytest.approx(share, abs=5 * np.sqrt(share * (1 - share) / n))
    found = slipped.sum()
    assert stretches[slipped].std() == pytest.approx(sigma, rel=5 / np.sqrt(2 * found))
    assert abs(stretches[slipped].mean()) < 5 * sigma / np.sqrt(found)


def test_a_slip_turns_the_robot_unnoticed() -> None:
    wheels = replace(PERFECT, slip=1.0, sigma_slip=0.0, sigma_slip_turn=0.6)
    rng = np.random.default_rng(4)
    n = 2000
    turns = [wheels.measure(straight(0.99 * SLIP, 3), rng)[-1, 2] for _ in range(n)]
    assert np.std(turns) == pytest.approx(0.6 * 0.99 * SLIP, rel=5 / np.sqrt(2 * n))


def test_wheels_do_not_turn_while_the_robot_is_carried() -> None:
    truth = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [9.0, 9.0, 2.0], [9.0, 9.0, 2.5]])
    odometry = PERFECT.measure(truth, np.random.default_rng(0), kidnapped=[2])
    np.testing.assert_allclose(odometry, [[0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0.5]], atol=1e-12)


@pytest.mark.parametrize("wrong", [{"sigma_drift": -0.1}, {"sigma_turn": np.nan}, {"slip": 1.1}])
def test_what_cannot_be_right_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        Wheels(**wrong)
