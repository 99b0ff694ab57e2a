"""How the simulated laser errs, and what it sees."""

import numpy as np
import pytest

from mcloc.errors import ConfigError
from mcloc.geometry import compose
from mcloc.maps.occupancy import FREE, OccupancyGrid
from mcloc.simulation import Laser, office_world, ranges
from mcloc.simulation.people import RADIUS

EXACT = {"sigma": 0.0, "missing": 0.0}
NOWHERE = OccupancyGrid(np.full((4, 4), FREE, np.int8), 0.1, np.zeros(3))


def test_the_laser_errs_by_sigma_and_misses_as_many_as_it_says() -> None:
    world, laser = office_world(0), Laser(sigma=0.03, missing=0.1, range_max=30.0)
    robot = np.tile([10.0, 7.0, 0.4], (50, 1))
    measured = laser.measure(world, robot, np.random.default_rng(2))
    exact = ranges(world, compose(robot, laser.mount), laser.angles, laser.range_max)
    returned = np.isfinite(measured)
    n = measured.size
    assert (~returned).mean() == pytest.approx(0.1, abs=5 * np.sqrt(0.1 * 0.9 / n))
    errors = (measured - exact)[returned]
    assert errors.std() == pytest.approx(0.03, rel=5 / np.sqrt(2 * n))
    assert abs(errors.mean()) < 5 * 0.03 / np.sqrt(returned.sum())


def test_beams_are_spread_evenly_over_the_field_of_view() -> None:
    angles = Laser(beams=5, fov=np.pi / 2).angles
    np.testing.assert_allclose(angles, np.radians([-45.0, -22.5, 0.0, 22.5, 45.0]))


def test_a_person_hides_the_wall_and_is_seen_at_the_place_of_the_moment() -> None:
    laser = Laser(beams=2, fov=1e-9, mount=(0.2, 0.0, 0.0), **EXACT)
    robot = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, np.pi / 2]])
    people = [[[3.0, 0.0], [3.0, 0.0]], [[9.0, 0.0], [0.0, 1.5]]]
    measured = laser.measure(NOWHERE, robot, np.random.default_rng(0), people=people)
    np.testing.assert_allclose(measured[:, 0], [3.0 - 0.2 - RADIUS, 1.5 - 0.2 - RADIUS])


def test_what_is_too_near_or_too_far_does_not_return() -> None:
    laser = Laser(beams=2, fov=1e-9, range_min=0.5, range_max=4.0, mount=(0, 0, 0), **EXACT)
    robot = np.zeros((3, 3))
    people = [[[0.6, 0.0], [3.0, 0.0], [4.3, 0.0]]]
    measured = laser.measure(NOWHERE, robot, np.random.default_rng(0), people=people)
    np.testing.assert_allclose(measured[:, 0], [np.inf, 3.0 - RADIUS, np.inf])


@pytest.mark.parametrize(
    "wrong",
    [
        {"beams": 1},
        {"fov": 7.0},
        {"range_max": 0.0},
        {"range_min": 10.0},
        {"missing": 1.5},
        {"mount": (0.0, 0.0)},
        {"mount": (0.0, np.nan, 0.0)},
    ],
)
def test_what_cannot_be_right_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        Laser(**wrong)  # type: ignore[arg-type]
