"""The generated floors: closed, connected, and unlike their mirror images or just like them."""

import numpy as np
import pytest
from scipy import ndimage

from mcloc.errors import ConfigError
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation import WORLDS, museum_world, office_world
from mcloc.simulation.museum import AROUND
from mcloc.simulation.office import DOOR

SEEDS = range(12)
ALL = pytest.mark.parametrize("name", WORLDS)


def regions(world: OccupancyGrid, clearance: float) -> tuple[np.ndarray, int]:
    """Where one can be this many metres from all that is not free, in connected parts."""
    to_wall = ndimage.distance_transform_edt(world.free) * world.resolution
    return ndimage.label(to_wall > clearance, np.ones((3, 3)))


@ALL
@pytest.mark.parametrize("seed", SEEDS)
def test_walls_close_the_floor_off(name: str, seed: int) -> None:
    world = WORLDS[name](seed)
    touched = ndimage.binary_dilation(world.free, np.ones((3, 3)))
    assert not (touched & world.unknown).any()


@pytest.mark.parametrize("symmetric", [False, True])
@pytest.mark.parametrize("rooms", [3, 9, 14])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_robot_gets_into_every_room(seed: int, rooms: int, symmetric: bool) -> None:
    world = office_world(seed, rooms=rooms, symmetric=symmetric)
    reachable, _ = regions(world, 0.35)
    wider_than_doors, n = regions(world, DOOR / 2 + 0.1)
    assert n >= rooms + 1
    assert len(np.unique(reachable[wider_than_doors > 0])) == 1


@pytest.mark.parametrize("seed", SEEDS)
def test_halls_are_wide_and_wide_open(seed: int) -> None:
    world = museum_world(seed)
    _, n = regions(world, AROUND / 2 - 0.1)
    assert n == 1
    to_wall = ndimage.distance_transform_edt(world.free) * world.resolution
    assert to_wall.max() > 2.0
    # Walls, showcases and pillars: more things than the frame of walls.
    assert ndimage.label(world.occupied)[1] > 20


@pytest.mark.parametrize("world", [office_world, museum_world])
@pytest.mark.parametrize("seed", SEEDS)
def test_no_half_turn_or_mirror_image_fits(world, seed: int) -> None:  # type: ignore[no-untyped-def]
    walls = world(seed).occupied
    for image in (walls[::-1, ::-1], walls[::-1], walls[:, ::-1]):
        assert (walls & ~image).sum() > 0.15 * walls.sum()


@pytest.mark.parametrize("resolution", [0.03, 0.05, 0.1])
@pytest.mark.parametrize("seed", SEEDS)
def test_half_a_turn_maps_a_symmetric_floor_onto_itself(seed: int, resolution: float) -> None:
    world = office_world(seed, resolution, symmetric=True)
    np.testing.assert_array_equal(world.cells, world.cells[::-1, ::-1])
    assert (world.cells != world.cells[::-1]).any()
    assert (world.cells != world.cells[:, ::-1]).any()


@ALL
def test_the_seed_is_the_world(name: str) -> None:
    world = WORLDS[name]
    assert (world(1).cells == world(1).cells).all()
    assert (world(1).cells != world(2).cells).any()


@pytest.mark.parametrize(
    ("world", "width", "depth", "wall"),
    [(office_world, 20.0, 15.0, 0.15), (museum_world, 40.0, 30.0, 0.3)],
)
@pytest.mark.parametrize("resolution", [0.05, 0.1])
def test_a_floor_measures_what_it_should(world, width, depth, wall, resolution) -> None:  # type: ignore[no-untyped-def]
    floor = world(0, resolution)
    rows, columns = np.nonzero(floor.free)
    for cells, side in ((columns, width), (rows, depth)):
        between_walls = (side - 2 * wall) / resolution
        assert np.ptp(cells) + 1 == pytest.approx(between_walls, abs=2.0)  # each end is rounded


def test_only_surfaces_are_occupied() -> None:
    """As in maps made by robots: a wall cell has a free neighbour."""
    floor = museum_world(1)
    near_free = ndimage.binary_dilation(floor.free, np.ones((3, 3)))
    assert not (floor.occupied & ~near_free).any()
    assert not (floor.unknown & near_free).any()


def test_more_rooms_make_a_wider_floor() -> None:
    assert office_world(0, rooms=17).cells.shape[1] > office_world(0).cells.shape[1]
    with pytest.raises(ConfigError, match="rooms"):
        office_world(0, rooms=2)


@pytest.mark.parametrize("world", [office_world, museum_world])
@pytest.mark.parametrize("resolution", [0.0, -0.05, 0.2, float("nan")])
def test_a_resolution_that_leaves_no_walls_is_refused(world, resolution: float) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ConfigError, match="resolution"):
        world(0, resolution)
