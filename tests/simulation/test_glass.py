"""How much of the walls is glass, and what becomes of beams that meet it."""

import numpy as np
import pytest

from mcloc.errors import ConfigError
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.simulation import office_world, ranges
from mcloc.simulation.glass import PANE, SHARPNESS, panes, ranges_past_glass

RESOLUTION = 0.1
PLACES = np.arange(3.0, 7.0, 0.002)  # m, where beams start


@pytest.fixture
def walls() -> OccupancyGrid:
    """Two walls across x, at 3 m and at 5 m."""
    cells = np.full((100, 80), FREE, dtype=np.int8)
    cells[:, [30, 50]] = OCCUPIED
    return OccupancyGrid(cells, RESOLUTION, np.zeros(3))


def beams(walls: OccupancyGrid, angle: float, seed: int = 0) -> np.ndarray:
    """Ranges of beams at an angle to the first wall's normal; that wall is of glass."""
    glass = np.zeros_like(walls.occupied)
    glass[:, 30] = True
    sensors = np.column_stack([np.full_like(PLACES, 2.0), PLACES, np.full_like(PLACES, angle)])
    rng = np.random.default_rng(seed)
    return ranges_past_glass(walls, glass, sensors, np.zeros(1), 20.0, rng)[:, 0]


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_each_square_is_glazed_with_the_same_chance(share: float) -> None:
    cells = np.full((100 * 15, 60 * 15), OCCUPIED, dtype=np.int8)
    glass = panes(OccupancyGrid(cells, PANE / 15, np.zeros(3)), share, np.random.default_rng(0))
    squares = glass.reshape(100, 15, 60, 15).mean(axis=(1, 3))
    assert set(np.unique(squares)) <= {0.0, 1.0}
    n = squares.size
    assert squares.mean() == pytest.approx(share, abs=5 * np.sqrt(share * (1 - share) / n))


def test_only_walls_are_glass() -> None:
    world = office_world(0)
    glass = panes(world, 0.5, np.random.default_rng(1))
    assert glass.any()
    assert not (glass & ~world.occupied).any()


@pytest.mark.parametrize("share", [-0.1, 1.1, np.nan])
def test_a_share_is_from_0_to_1(share: float) -> None:
    with pytest.raises(ConfigError, match="glass"):
        panes(office_world(0), share, np.random.default_rng(0))


def test_straight_on_glass_is_a_wall(walls: OccupancyGrid) -> None:
    np.testing.assert_allclose(beams(walls, 0.0), 1.0)


@pytest.mark.parametrize("degrees", [10.0, -21.0, 35.0])
def test_it_returns_with_the_chance_of_its_angle_or_goes_on(
    walls: OccupancyGrid, degrees: float
) -> None:
    angle = np.radians(degrees)
    measured = beams(walls, angle)
    first = np.isclose(measured, 1.0 / np.cos(angle))
    assert (first | np.isclose(measured, 3.0 / np.cos(angle))).all()
    chance = np.cos(angle) ** SHARPNESS
    bound = 5 * np.sqrt(chance * (1 - chance) / len(measured))
    assert first.mean() == pytest.approx(chance, abs=bound)


def test_without_glass_nothing_changes() -> None:
    world = office_world(0)
    rng = np.random.default_rng(2)
    poses = np.column_stack([rng.uniform(1, 19, 50), np.full(50, 7.0), rng.uniform(-3, 3, 50)])
    angles = np.linspace(-1.5, 1.5, 31)
    none = np.zeros_like(world.occupied)
    found = ranges_past_glass(world, none, poses, angles, 12.0, rng)
    np.testing.assert_array_equal(found, ranges(world, poses, angles, 12.0))
