"""What there is to divide: states of a part of a domain, spread evenly, where a robot can be."""

import numpy as np
import pytest
from scipy.stats import chisquare
from scipy.stats.qmc import discrepancy

from mcloc.draws import Draws
from mcloc.environment import FreeSpace, Tiles
from mcloc.filters.hierarchical.domain import TRIES, Boxes, TileRows, evenly, strides
from mcloc.filters.hierarchical.places import Places
from mcloc.filters.hierarchical.region import Region, keys_of, region_of
from mcloc.filters.hierarchical.zones import ZoneOnly
from mcloc.geometry import between, compose
from mcloc.maps.occupancy import FREE, OccupancyGrid
from mcloc.simulation import office_world
from mcloc.statespace import LINE, PLANE, SE2

OFFICE = office_world(1)
TURNED = OccupancyGrid(OFFICE.cells, OFFICE.resolution, np.array([30.0, -12.0, 0.7]))
MAPS = {"as it is": OFFICE, "turned": TURNED}
every_map = pytest.mark.parametrize("grid", MAPS.values(), ids=MAPS)


def box(grid):
    return Boxes.of_map(grid, FreeSpace(grid))


def test_strides_are_powers_of_the_root_of_x_to_the_d_plus_1():
    """1 / golden ratio on a line, 1 / 1.3247… and its square in the plane."""
    assert strides(1)[:, 0] == pytest.approx([2.0 / (1.0 + np.sqrt(5.0))])
    for d in range(1, 7):
        root = 1.0 / strides(d)[0, 0]
        assert root ** (d + 1) == pytest.approx(root + 1.0)
        assert strides(d)[:, 0] == pytest.approx(root ** -np.arange(1.0, d + 1.0))
    assert 1.0 / strides(2)[0, 0] == pytest.approx(1.324717957244746)


@pytest.mark.parametrize("d", [2, 3, 4])
def test_points_are_more_even_than_chance(d):
    """Centred discrepancy, against the least of 20 random sets."""
    rng = np.random.default_rng(1)
    for n in (64, 512):
        u = evenly(n, d)
        assert u.shape == (d, n)
        assert ((u >= 0.0) & (u < 1.0)).all()
        assert 2.0 * discrepancy(u.T) < min(discrepancy(rng.random((n, d))) for _ in range(20))


def test_points_on_a_line_are_at_equal_distances():
    assert evenly(4, 1).tolist() == [[0.125, 0.375, 0.625, 0.875]]


@every_map
def test_the_domain_of_a_map_is_the_box_around_its_free_cells(grid):
    """Every free pose is in it, and none of its sides could be nearer."""
    domain = box(grid)
    x = domain.environment.sample(Draws(1), 0, 100_000)
    assert domain.whole.space is SE2
    assert domain.whole.holds(x).all()
    assert domain.whole.sides[2] == pytest.approx(2.0 * np.pi)
    rows, columns = np.nonzero(grid.free)
    for corner in ((0, 0), (0, 1), (1, 0), (1, 1)):
        local = np.stack([columns + corner[0], rows + corner[1]], axis=1) * grid.resolution
        poses = compose(grid.origin, np.column_stack([local, np.zeros(len(rows))]))
        assert (poses[:, :2].min(axis=0) >= domain.whole.low[:2] - 1e-9).all()
        assert (poses[:, :2].max(axis=0) <= domain.whole.high[:2] + 1e-9).all()
    # The box is one in the grid's own frame; its corners, not those of free cells, are turned.
    ends = between(grid.origin, np.array([*domain.whole.centre[:2], 0.0]))[:2] / grid.resolution
    middle = 0.5 * np.array(
        [columns.min() + columns.max() + 1, rows.min() + rows.max() + 1], dtype=float
    )
    assert ends == pytest.approx(middle, abs=1e-6)
    width, height = np.ptp(columns) + 1, np.ptp(rows) + 1
    c, s = abs(np.cos(grid.origin[2])), abs(np.sin(grid.origin[2]))
    expected = grid.resolution * np.array([c * width + s * height, s * width + c * height])
    assert domain.whole.sides[:2] == pytest.approx(expected)


def on_free(grid, x):
    """(N,): which poses are on free cells."""
    local = between(grid.origin, x.T)[:, :2] / grid.resolution
    columns, rows = np.floor(local).astype(int).T
    height, width = grid.cells.shape
    on = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    found = np.zeros(x.shape[1], dtype=bool)
    found[on] = grid.cells[rows[on], columns[on]] == FREE
    return found


def free_shares(grid, domain, depth, n=400_000):
    """{key: how much of its region is free}, by NumPy's random poses and the cells themselves."""
    rng = np.random.default_rng(2)
    whole = domain.whole
    x = whole.low[:, None] + whole.sides[:, None] * rng.random((3, n))
    free, keys = on_free(grid, x), keys_of(whole, x, depth)
    return {int(k): free[keys == k].mean() for k in np.unique(keys)}


@every_map
@pytest.mark.parametrize("depth", [0, 3, 6, 7])
def test_random_states_of_a_region_are_in_it_and_in_free_space(grid, depth):
    """Each has 1 + TRIES places: all of them are in walls with (1 − free share)^(1 + TRIES), if
    they are like independent ones.
    """
    domain, n = box(grid), 500
    missed, expected, drawn = 0, 0.0, 0
    for key, share in free_shares(grid, domain, depth).items():
        if share < 0.1:
            continue
        part = region_of(domain.whole, key)
        x = Places(domain, part).sample(Draws(key), 0, n)
        assert part.holds(x).all()
        missed += int((~on_free(grid, x)).sum())
        expected += n * (1.0 - share) ** (1 + TRIES)
        drawn += n
    assert drawn >= n
    assert missed <= expected + 4.5 * np.sqrt(expected) + 1.0


@every_map
def test_a_zone_is_the_likelier_the_more_of_it_is_free(grid):
    """U(zone) of the nodes down to depth 5: free cells × headings, counted by random poses;
    4096 points tell a share within some percent.
    """
    domain = box(grid)
    shares = [free_shares(grid, domain, depth) for depth in range(7)]
    uneven = []
    for depth in range(6):
        for key in shares[depth]:
            two = np.array([shares[depth + 1].get(2 * key + half, 0.0) for half in (0, 1)])
            if two.max() < 0.1:
                continue
            region = region_of(domain.whole, key)
            zones = ZoneOnly(domain).zones(region, depth % 3)
            expected = two / two.sum()
            assert np.exp(zones.log_density(np.array([[0.0, 1.0]]))) == pytest.approx(
                expected, abs=0.03
            )
            uneven.append(abs(expected[0] - 0.5))
    assert max(uneven) > 0.4 or grid.origin[2] == 0.0  # whose halves are all much alike


@every_map
def test_states_are_spread_over_free_space_as_it_is(grid):
    """Pooled into the regions of depth 5, by how many free cells × headings they have."""
    domain, n = box(grid), 8000
    shares = free_shares(grid, domain, 5)
    keys = np.array([k for k, share in shares.items() if share > 0.02])
    expected = np.array([shares[k] for k in keys])
    x = Places(domain, domain.whole).sample(Draws(4), 0, n)
    found = np.array([(keys_of(domain.whole, x, 5) == k).sum() for k in keys], dtype=float)
    assert chisquare(found, expected / expected.sum() * found.sum()).pvalue > 1e-4


@pytest.mark.parametrize("d", [1, 3, 4, 6])
def test_places_are_the_same_whatever_the_chunk(d):
    """Also where a state has more axes than a particle has numbers."""
    space = type(SE2)(tuple("abcdef"[:d]), ("m",) * d, (False,) * d)
    whole = Region(space, np.zeros(d), np.arange(1.0, d + 1.0))
    places = Places(Boxes(whole, Everywhere()), whole)
    x = places.sample(Draws(5, 2), 0, 50)
    parts = [places.sample(Draws(5, 2), a, b - a) for a, b in ((0, 7), (7, 8), (8, 50))]
    assert np.array_equal(np.concatenate(parts, axis=1), x)
    assert whole.holds(x).all()
    many = places.sample(Draws(5, 2), 0, 4000) / whole.high[:, None]
    assert np.abs(np.corrcoef(many) - np.eye(d)).max() < 4.5 / np.sqrt(4000) if d > 1 else True
    assert many.mean(axis=1) == pytest.approx(np.full(d, 0.5), abs=4.5 / np.sqrt(12 * 4000))


class Everywhere:
    """No walls."""

    def log_prior(self, x):
        return np.zeros(x.shape[1])


def rows(*shape):
    n = np.array(shape, dtype=float)
    space = LINE if len(shape) == 1 else PLANE
    return TileRows(Region(space, np.full(len(n), -0.5), n - 0.5), Tiles(shape))


@pytest.mark.parametrize("shape", [(11,), (128,), (8, 6)])
def test_tiles_of_a_region_are_those_in_it_each_as_often(shape):
    domain = rows(*shape)
    tiles = np.indices(shape).reshape(len(shape), -1).astype(float)
    for key in range(1, 32):
        part = region_of(domain.whole, key)
        inside = tiles[:, part.holds(tiles)]
        if not inside.size:
            continue
        counts = [len(np.unique(row)) for row in inside]
        axes = [(np.arange(4 * c) + 0.5) / (4 * c) for c in counts]
        u = np.stack(np.meshgrid(*axes, indexing="ij")).reshape(len(shape), -1)
        found, n = np.unique(domain.states(part, u), axis=1, return_counts=True)
        assert np.array_equal(found, inside)
        assert (n == 4 ** len(shape)).all()


@pytest.mark.parametrize("shape", [(11,), (5, 3)])
def test_a_region_without_a_tile_has_the_nearest_one(shape):
    """Deep down, where a row has no power of 2 of them: always a tile, within one of the region."""
    domain = rows(*shape)
    u = np.random.default_rng(1).random((len(shape), 50))
    for key in range(1, 2**8):
        part = region_of(domain.whole, key)
        x = domain.states(part, u)
        assert domain.environment.contain(x).all()
        assert (np.abs(part.beyond(x)) < 1.0).all()


def test_impossible_states_have_next_to_no_weight_but_some():
    """A node all of whose states a move has led off the tiles still has a belief."""
    domain = rows(11)
    x = np.array([[-3.0, 0.0, 10.0, 11.0, 2.5]])
    assert np.isneginf(domain.environment.log_prior(x)).tolist() == [True, False, False, True, True]
    found = Places(domain, domain.whole).log_prior(x)
    assert np.exp(found)[[1, 2]].tolist() == [1.0, 1.0]
    assert (np.exp(found) > 0.0).all()
    assert (np.exp(found)[[0, 3, 4]] < 1e-100).all()
    assert np.array_equal(
        Places(domain, domain.whole).log_density(x),
        np.where(np.isneginf(domain.environment.log_prior(x)), -np.inf, -np.log(11.0)),
    )
