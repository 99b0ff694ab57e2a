"""How the simulated robot drives."""

import numpy as np
import pytest

from mcloc.errors import ConfigError
from mcloc.geometry import between
from mcloc.simulation import follow
from mcloc.simulation.robot import LOOKAHEAD, STEP, TURN_MAX

SPEED = 0.5  # m/s


def test_the_robot_keeps_to_its_speed_and_turns_smoothly_to_the_end() -> None:
    path = follow([[0.0, 0.0], [5.0, 0.0], [5.0, 5.0], [2.0, 0.0]], SPEED)
    motion = between(path.poses[:-1], path.poses[1:])
    assert np.hypot(motion[:, 0], motion[:, 1]).max() <= SPEED * STEP + 1e-12
    assert np.abs(motion[:, 2]).max() <= TURN_MAX * STEP + 1e-12
    assert np.hypot(*(path.poses[-1, :2] - [2.0, 0.0])) <= LOOKAHEAD
    np.testing.assert_allclose(np.diff(path.t), STEP)


@pytest.mark.parametrize(
    ("route", "speed"),
    [
        ([[0.0, 0.0]], 0.5),
        ([[0.0, 0.0], [0.1, 0.1]], 0.5),
        ([0.0, 1.0], 0.5),
        ([[0.0, 0.0], [np.nan, 1.0]], 0.5),
        ([[0.0, 0.0], [3.0, 0.0]], 0.0),
    ],
)
def test_a_route_that_leads_nowhere_is_refused(route: list[list[float]], speed: float) -> None:
    with pytest.raises(ConfigError, match=r"route|speed"):
        follow(route, speed)
