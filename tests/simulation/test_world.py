"""The generated floor: closed, connected, unlike its mirror images."""

import numpy as np
import pytest
from scipy import ndimage

from mcloc.errors import ConfigError
from mcloc.simulation import office_world
from mcloc.simulation.world import DOOR, ROOMS_ABOVE, ROOMS_BELOW

SEEDS = range(12)


@pytest.mark.parametrize("seed", SEEDS)
def test_walls_close_the_floor_off(seed: int) -> None:
    world = office_world(seed)
    touched = ndimage.binary_dilation(world.free, np.ones((3, 3)))
    assert not (touched & world.unknown).any()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_robot_gets_into_every_room(seed: int) -> None:
    world = office_world(seed)
    to_wall = ndimage.distance_transform_edt(world.free) * world.resolution
    reachable, _ = ndimage.label(to_wall > 0.35, np.ones((3, 3)))
    wider_than_doors, n = ndimage.label(to_wall > DOOR / 2 + 0.1, np.ones((3, 3)))
    assert n >= ROOMS_BELOW + ROOMS_ABOVE + 1
    assert len(np.unique(reachable[wider_than_doors > 0])) == 1


@pytest.mark.parametrize("seed", SEEDS)
def test_no_half_turn_or_mirror_image_fits(seed: int) -> None:
    walls = office_world(seed).occupied
    for image in (walls[::-1, ::-1], walls[::-1], walls[:, ::-1]):
        assert (walls & ~image).sum() > 0.15 * walls.sum()


def test_the_seed_is_the_world() -> None:
    assert (office_world(1).cells == office_world(1).cells).all()
    assert (office_world(1).cells != office_world(2).cells).any()


@pytest.mark.parametrize("resolution", [0.05, 0.1])
def test_the_floor_measures_20_by_15_metres(resolution: float) -> None:
    world = office_world(0, resolution)
    rows, columns = np.nonzero(~world.unknown)
    assert np.ptp(columns) + 1 == round(20.0 / resolution)
    assert np.ptp(rows) + 1 == round(15.0 / resolution)
    assert world.state_at([0.01, 0.01, 0.0]) == "occupied"
    assert world.state_at([-0.01, -0.01, 0.0]) == "unknown"
    assert world.state_at([10.0, 7.0, 0.0]) == "free"


@pytest.mark.parametrize("resolution", [0.0, -0.05, 0.2, float("nan")])
def test_a_resolution_that_leaves_no_walls_is_refused(resolution: float) -> None:
    with pytest.raises(ConfigError, match="resolution"):
        office_world(0, resolution)
