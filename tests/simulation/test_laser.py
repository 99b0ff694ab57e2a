"""How the simulated laser errs, and what it sees."""

import numpy as np
import pytest
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.geometry import Poses, compose, wrap
from mcloc.maps.occupancy import FREE, OccupancyGrid
from mcloc.simulation import Laser, Roadmap, office_world, ranges
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
        {"cone": -0.1},
        {"cone": 4.0},
        {"sigma_relative": -0.1},
        {"mount": (0.0, 0.0)},
        {"mount": (0.0, np.nan, 0.0)},
    ],
)
def test_what_cannot_be_right_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        Laser(**wrong)  # type: ignore[arg-type]


SONAR = {"beams": 16, "fov": 2 * np.pi * 15 / 16, "range_max": 3.0, "mount": (0.1, 0.0, 0.2)}


def nearest_wall_points(
    world: OccupancyGrid, robot: Poses, laser: Laser, cone: float
) -> NDArray[np.float64]:
    """(N, B): the least distance to any point of a wall within each cone, casting no ray: what is
    nearest in a cone is hidden by nothing. Points are 5 mm apart, around occupied cells.
    """
    row, column = np.nonzero(world.occupied)
    along = np.linspace(0.0, 1.0, 1 + round(world.resolution / 0.005))
    border = np.concatenate(
        [np.stack([along, np.full_like(along, side)]) for side in (0.0, 1.0)]
        + [np.stack([np.full_like(along, side), along]) for side in (0.0, 1.0)],
        axis=1,
    )
    local = (np.stack([column, row])[:, :, None] + border[:, None]) * world.resolution
    x, y = compose(world.origin, np.insert(local.reshape(2, -1).T, 2, 0.0, axis=1))[:, :2].T
    found = np.full((len(robot), laser.beams), np.inf)
    for i, sensor in enumerate(compose(robot, laser.mount)):
        distance = np.hypot(x - sensor[0], y - sensor[1])
        bearing = np.arctan2(y - sensor[1], x - sensor[0]) - sensor[2]
        for b, angle in enumerate(laser.angles):
            within = np.abs(wrap(bearing - angle)) <= cone / 2.0
            found[i, b] = distance[within].min(initial=np.inf)
    return found


@pytest.mark.parametrize("degrees", [5.0, 20.0, 60.0])
def test_a_cone_measures_the_nearest_wall_in_it(degrees: float) -> None:
    """Rays are up to 1° apart, and walls recede from their nearest point at 45° or more to at least
    one side: a ray is longer by sin 45° / sin 44° at most. Points are found 5 mm apart.
    """
    world, cone = office_world(2), np.radians(degrees)
    laser = Laser(**SONAR, cone=cone, **EXACT)
    rng = np.random.default_rng(1)
    points = Roadmap(world).points
    places = points[rng.integers(len(points), size=10)]
    robot = np.column_stack([places, rng.uniform(-np.pi, np.pi, 10)])
    measured = laser.measure(world, robot, rng)
    nearest = nearest_wall_points(world, robot, laser, cone)
    longer = np.sin(np.pi / 4) / np.sin(np.pi / 4 - np.radians(1.0))
    seen = nearest < 3.0 / longer - 0.01
    assert (measured <= longer * nearest + 1e-9)[seen].all()
    # A wall's point just within may lie between two of those, the next of which is just outside.
    assert (measured >= nearest_wall_points(world, robot, laser, cone + 0.02) - 0.005).all()
    assert 0.5 < seen.mean() < 1.0
    alone = Laser(**SONAR, **EXACT).measure(world, robot, rng)
    assert (measured <= alone).all()
    assert (measured < alone - 0.05)[np.isfinite(measured)].mean() > 0.1


def test_a_person_in_the_cone_is_nearest() -> None:
    sonar = Laser(beams=2, fov=1e-9, mount=(0.0, 0.0, 0.0), cone=np.radians(20.0), **EXACT)
    beside = 2.0 * np.tan(np.radians(10.0)) + RADIUS  # more than the radius from the axis
    people = [[[2.0, beside - 0.05]], [[2.0, -beside - 0.05]]]
    measured = sonar.measure(NOWHERE, np.zeros((1, 3)), np.random.default_rng(0), people=people)
    assert 1.9 < measured[0, 0] < 2.1
    without = sonar.measure(NOWHERE, np.zeros((1, 3)), np.random.default_rng(0), people=people[1:])
    assert without[0, 0] == np.inf


def test_noise_may_grow_with_the_range() -> None:
    """5 % of it beside 1 cm, at 0.5 m and at 2.5 m."""
    laser = Laser(
        beams=2, fov=1e-9, mount=(0.0, 0.0, 0.0), sigma=0.01, sigma_relative=0.05, missing=0.0
    )
    robot, n = np.zeros((4000, 3)), 8000
    for distance in (0.5, 2.5):
        people = np.full((1, 4000, 2), [distance + RADIUS, 0.0])
        measured = laser.measure(NOWHERE, robot, np.random.default_rng(5), people=people)
        sigma = np.hypot(0.01, 0.05 * distance)
        assert measured.std() == pytest.approx(sigma, rel=5 / np.sqrt(2 * n))
        assert measured.mean() == pytest.approx(distance, abs=5 * sigma / np.sqrt(n))
    nothing = laser.measure(NOWHERE, robot, np.random.default_rng(5))
    assert (nothing == np.inf).all()
