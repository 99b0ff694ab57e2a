"""The graph of a map: the rooms, corridors and passages that somebody would draw."""

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt, label

from mcloc.errors import MapError
from mcloc.geometry import compose
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.maps.places import places
from mcloc.simulation import museum_world, office_world

CELL = 0.05


def floor(width, height, *boxes, origin=(0.0, 0.0, 0.0)):
    """A block of wall, metres, with boxes (left, bottom, right, top) cut out of it."""
    cells = np.full((round(height / CELL), round(width / CELL)), OCCUPIED, dtype=np.int8)
    for box in boxes:
        left, bottom, right, top = (round(v / CELL) for v in box)
        cells[bottom:top, left:right] = FREE
    return OccupancyGrid(cells, CELL, np.array(origin))


def office(door=1.0, origin=(0.0, 0.0, 0.0)):
    """A corridor 12 m × 2 m with rooms above: A and B with doors, C without any; and a pocket."""
    return floor(
        *(13.0, 8.0),
        (0.5, 0.5, 12.5, 2.5),
        *((0.5, 2.7, 4.0, 7.0), (4.2, 2.7, 8.2, 7.0), (8.4, 2.7, 12.5, 7.0)),
        *((2.0, 2.5, 2.0 + door, 2.7), (4.5, 2.5, 4.5 + door, 2.7)),
        (0.5, 7.2, 1.2, 7.9),
        origin=origin,
    )


def node_at(graph, x, y):
    row, column = graph.grid.cell_of(np.array([x, y, 0.0]))
    return int(graph.nearest[row, column])


def linked(graph):
    return {tuple(edge) for edge in graph.edges.tolist()}


def test_rooms_are_nodes_and_the_corridor_is_cut_into_pieces():
    graph = places(office(), radius=0.25, piece=3.0)
    rooms = [node_at(graph, x, 5.0) for x in (2.0, 6.0, 10.0)]
    pieces = [node_at(graph, x, 1.5) for x in (2.0, 5.0, 8.0, 11.0)]
    assert len({*rooms, *pieces}) == len(graph) == 7
    expected = {(pieces[0], rooms[0]), (pieces[1], rooms[1])}
    expected |= {(pieces[k], pieces[k + 1]) for k in range(3)}
    assert linked(graph) == {tuple(sorted(edge)) for edge in expected}


@pytest.mark.parametrize(("door", "doors"), [(1.0, 2), (0.6, 2), (0.4, 0)])
def test_a_door_is_an_edge_if_a_robot_fits_through(door, doors):
    graph = places(office(door), radius=0.25)
    assert len(graph.edges) == 3 + doors
    assert len(graph) == 7


def test_areas_and_centres_are_of_where_a_robot_fits():
    """Room C of 4.1 m × 4.3 m, without 0.25 m at its walls."""
    graph = places(office())
    room = node_at(graph, 10.0, 5.0)
    assert graph.areas[room] == pytest.approx(3.6 * 3.8, rel=0.06)
    assert graph.centres[room] == pytest.approx([10.45, 4.85], abs=CELL)


def test_a_pocket_is_no_place_and_a_room_that_nothing_leads_to_is_one():
    """The pocket of 0.7 m × 0.7 m has room for a robot, but less than 1 m² of it."""
    graph = places(office(), least=1.0)
    assert not graph.standing[round(7.2 / CELL) :].any()
    room = node_at(graph, 10.0, 5.0)
    assert room not in graph.edges
    assert len(places(office(), least=0.01)) == len(graph) + 1


def test_it_turns_with_the_map():
    frame = np.array([40.0, -3.0, 2.0])
    here, there = places(office()), places(office(origin=frame))
    assert (here.nearest == there.nearest).all()
    at = np.column_stack([here.centres, np.zeros(len(here))])
    assert there.centres == pytest.approx(compose(frame, at)[:, :2])


def test_where_three_corridors_meet_is_a_junction():
    """The one node with three neighbours; the ends of the corridors have one."""
    graph = places(floor(20.0, 11.0, (1.0, 1.0, 19.0, 3.0), (9.0, 3.0, 11.0, 10.0)))
    degree = np.bincount(graph.edges.ravel())
    assert np.bincount(degree)[[1, 3]].tolist() == [3, 1]
    assert degree.max() == 3
    junction = int(degree.argmax())
    assert np.hypot(*(graph.centres[junction] - [10.0, 2.0])) < 2.5
    for end in ((1.5, 2.0), (18.5, 2.0), (10.0, 9.5)):
        assert degree[node_at(graph, *end)] == 1


def test_a_hall_is_cut_too():
    graph = places(floor(22.0, 22.0, (1.0, 1.0, 21.0, 21.0)), piece=4.0)
    assert len(graph) >= 12
    assert graph.areas.max() < 45.0


@pytest.mark.parametrize("cells", [(OCCUPIED, OCCUPIED), (UNKNOWN, OCCUPIED), (FREE, OCCUPIED)])
def test_a_map_without_a_place_is_refused(cells):
    """The last one has free stripes, 0.1 m wide."""
    stripes = np.repeat(np.resize(np.array(cells, dtype=np.int8), 40), 2)
    grid = OccupancyGrid(np.tile(stripes, (80, 1)), CELL, np.zeros(3), name="stripes")
    with pytest.raises(MapError, match=r"stripes: no place of 1 m² .* radius 0.25 m"):
        places(grid)


def check(graph, radius, least):
    """What holds for every graph."""
    grid, standing = graph.grid, graph.standing
    free = distance_transform_edt(np.pad(grid.free, 1))[1:-1, 1:-1] * grid.resolution
    assert (free[standing] >= radius).all()
    assert graph.nearest.min() == 0
    assert graph.nearest.max() == len(graph) - 1
    for k in range(len(graph)):
        cells = standing & (graph.nearest == k)
        assert label(cells)[1] == 1
        assert cells.sum() * grid.resolution**2 == pytest.approx(graph.areas[k])
    assert (graph.areas >= least).all()
    touching = {
        (min(a, b), max(a, b))
        for first, second in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:]))
        for a, b in zip(graph.nearest[first].ravel(), graph.nearest[second].ravel(), strict=True)
        if a != b
    }
    assert linked(graph) <= touching
    assert (graph.edges[:, 0] < graph.edges[:, 1]).all()


@pytest.mark.parametrize("seed", range(3))
def test_of_simulated_floors(seed):
    for world in (office_world(seed), museum_world(seed)):
        check(places(world, 0.2, 3.0, 1.0), 0.2, 1.0)


MAPS = ["intel/intel_train.yaml", "fhw/fhw_train.yaml", "wean/wean.dat.gz", "maps/willow.yaml"]


@pytest.mark.parametrize("name", MAPS)
def test_of_recorded_maps(data_dir, name):
    graph = places(OccupancyGrid.load(data_dir / name))
    check(graph, 0.25, 1.0)
    assert 30 <= len(graph) <= 200
    assert len(graph.edges) >= 0.8 * len(graph)
