"""Ranges to discs against the roots of the quadratic equation of a ray and a circle."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mcloc.simulation.discs import ranges_to_discs

REACH = 20.0  # m


def by_roots(
    sensor: tuple[float, float, float], centre: tuple[float, float], radius: float
) -> float:
    """The least t ≥ 0 with |s + t d − c|² = r²."""
    s, c = np.array(sensor[:2]), np.array(centre)
    d = np.array([np.cos(sensor[2]), np.sin(sensor[2])])
    roots = np.roots([1.0, 2.0 * d @ (s - c), (s - c) @ (s - c) - radius**2])
    ahead = [root.real for root in roots if np.isreal(root) and root.real >= 0.0]
    return min(ahead, default=np.inf)


@given(
    sensor=st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-np.pi, np.pi)),
    centre=st.tuples(st.floats(-5, 5), st.floats(-5, 5)),
    radius=st.floats(0.1, 2.0),
    angle=st.floats(-np.pi, np.pi),
)
def test_as_the_quadratic_equation_has_it(
    sensor: tuple[float, float, float],
    centre: tuple[float, float],
    radius: float,
    angle: float,
) -> None:
    distance = np.hypot(sensor[0] - centre[0], sensor[1] - centre[1])
    heading = sensor[2] + angle
    across = (centre[0] - sensor[0]) * np.sin(heading) - (centre[1] - sensor[1]) * np.cos(heading)
    assume(abs(abs(across) - radius) > 1e-6 and abs(distance - radius) > 1e-6)  # no mere touch
    found = ranges_to_discs(
        np.array([sensor]), np.array([angle]), REACH, np.array([[centre]]), radius
    )[0, 0]
    inside = distance < radius
    expected = 0.0 if inside else by_roots((*sensor[:2], heading), centre, radius)
    assert found == pytest.approx(expected, abs=1e-6)


def test_the_first_disc_in_reach_counts_at_each_pose() -> None:
    sensors = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, np.pi / 2], [0.0, 0.0, np.pi]])
    centres = np.array(
        [
            [[2.0, 0.0], [0.0, 9.0], [-2.0, 0.0]],
            [[4.0, 0.0], [0.0, 4.0], [np.nan, np.nan]],
        ]
    )
    found = ranges_to_discs(sensors, np.zeros(1), 8.0, centres, 0.5)
    np.testing.assert_allclose(found, [[1.5], [3.5], [1.5]])
    np.testing.assert_allclose(ranges_to_discs(sensors, np.zeros(1), 1.5, centres, 0.5), np.inf)


def test_without_discs_nothing_is_seen() -> None:
    found = ranges_to_discs(np.zeros((3, 3)), np.zeros(4), 8.0, np.empty((0, 3, 2)), 0.5)
    np.testing.assert_array_equal(found, np.full((3, 4), np.inf))
