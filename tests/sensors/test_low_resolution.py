"""Virtual low-resolution sensors: positive everywhere, the same modes, and lower around these."""

import itertools

import numpy as np
import pytest

from mcloc.events import Sightings
from mcloc.experiments.tile_world import EFOLDS, domain, from_afar
from mcloc.maps.landmarks import Landmarks
from mcloc.sensors.grey_tile import GreyTile, PreciseGreyTile
from mcloc.sensors.landmarks import LandmarkModel
from mcloc.sensors.low_resolution import LEAST, LeftOut, LowResolution
from mcloc.statespace import LINE, PLANE

ROW, PLANE_SHAPE = (31,), (9, 7)


def tiles(shape):
    """(D, n): all of them, in the order of np.ndindex."""
    return np.indices(shape).reshape(len(shape), -1).astype(float)


class Table:
    """Likelihoods of tiles by a table for each value, 0 in about half of it, with several equal
    maxima.
    """

    def __init__(self, shape, seed):
        rng = np.random.default_rng(seed)
        self.shape = shape
        self.values = 0.9 * rng.random((4, np.prod(shape))) * (rng.random((4, 1)) < 2)
        self.values[rng.random(self.values.shape) < 0.5] = 0.0
        for row in self.values:
            row[rng.choice(len(row), 3, replace=False)] = 1.0

    def log_likelihood(self, x, z):
        inside = np.all((x >= 0) & (x < np.array(self.shape)[:, None]), axis=0)
        at = np.ravel_multi_index(tuple(np.where(inside, x, 0).astype(int)), self.shape)
        with np.errstate(divide="ignore"):
            return np.log(np.where(inside, self.values[z[0]][at], 0.0))

    def readings(self, z):
        return 3.0

    def beams(self, z):
        return 2

    def source(self, z):
        return "table"

    def explained(self, x, z):
        return np.full(x.shape[1], 0.25)


def sensors(shape):
    return {
        "grey": GreyTile(shape),
        "precise": PreciseGreyTile(shape, error=1),
        "exact": PreciseGreyTile(shape, error=0),
        "several modes": Table(shape, 1),
        "others": Table(shape, 2),
    }


def offsets(shape, reach, fall):
    """All of up to `reach` tiles along each axis; each tile takes `fall` off."""
    around = itertools.product(range(-reach, reach + 1), repeat=len(shape))
    found = np.array([o for o in around if any(o)], dtype=float).T
    return found, fall * np.abs(found).sum(axis=0)


VIRTUAL = {
    "floor alone": lambda s: LowResolution(s),
    "power": lambda s: LowResolution(s, 0.3),
    "near": lambda s: LowResolution(s, 1.0, *offsets(s.shape, 2, 0.4)),
    "far": lambda s: LowResolution(s, 0.5, *offsets(s.shape, max(s.shape), 0.3)),
    "region": lambda s: from_afar(s, domain(s).whole),
}
CASES = [(shape, name) for shape in (ROW, PLANE_SHAPE) for name in sensors(shape)]
every_sensor = pytest.mark.parametrize(("shape", "name"), CASES)
every_way = pytest.mark.parametrize("virtual", VIRTUAL.values(), ids=VIRTUAL)


def values_of(sensor):
    """Some of what may be measured."""
    if isinstance(sensor, Table):
        return [np.array([k]) for k in range(4)]
    return [np.array(z) for z in itertools.islice(np.ndindex(*sensor.shape), 0, None, 5)]


@every_sensor
@every_way
def test_it_is_positive_everywhere_and_has_the_same_modes(shape, name, virtual):
    sensor = sensors(shape)[name]
    low, x = virtual(sensor), tiles(shape)
    off = np.array([[-40.0, 300.0, 2.5]] * len(shape))
    for z in values_of(sensor):
        p, found = sensor.log_likelihood(x, z), low.log_likelihood(x, z)
        assert (np.exp(found) > 0.0).all()
        assert (np.exp(low.log_likelihood(off, z)) > 0.0).all()
        assert np.array_equal(found > found.max() - 1e-9, p > p.max() - 1e-9)
        assert found.max() == low.power * p.max()


@every_sensor
@every_way
def test_it_is_the_best_of_what_is_around_less_what_that_is_away(shape, name, virtual):
    """Written out, tile by tile."""
    sensor = sensors(shape)[name]
    low, x = virtual(sensor), tiles(shape)
    fall = {tuple(o): f for o, f in zip(low.offsets.T, low.falls, strict=True)}
    fall[(0.0,) * len(shape)] = 0.0
    for z in values_of(sensor)[:3]:
        p = low.power * sensor.log_likelihood(x, z)
        found = low.log_likelihood(x, z)
        for k, here in enumerate(x.T):
            near = [
                p[j] - fall[tuple(there - here)]
                for j, there in enumerate(x.T)
                if tuple(there - here) in fall
            ]
            assert found[k] == pytest.approx(max(*near, LEAST))


@pytest.mark.parametrize("shape", [ROW, PLANE_SHAPE])
@pytest.mark.parametrize("error", [0, 1, 2])
def test_it_falls_the_farther_from_what_can_be(shape, error):
    """Strictly, along every straight way from the tiles that may be read so. In the middle of a row
    all of these are modes; near its ends the outer ones are likelier.
    """
    sensor, x = PreciseGreyTile(shape, error=error), tiles(shape)
    low = from_afar(sensor, domain(sensor).whole)
    for z in values_of(sensor):
        possible = x[:, sensor.log_likelihood(x, z) > -np.inf]
        away = np.abs(x[:, :, None] - possible[:, None, :]).sum(axis=0).min(axis=1).reshape(shape)
        found = low.log_likelihood(x, z).reshape(shape)
        for axis in range(len(shape)):
            farther, step = np.diff(away, axis=axis), np.diff(found, axis=axis)
            assert (step[farther > 0] < 0.0).all()
            assert (step[farther < 0] > 0.0).all()


def test_beyond_the_offsets_it_no_longer_falls():
    sensor = PreciseGreyTile(ROW, error=0)
    low = LowResolution(sensor, 1.0, *offsets(ROW, 4, 0.5))
    found = low.log_likelihood(tiles(ROW), np.array([10]))
    assert found[6:15] == pytest.approx(-0.5 * np.abs(np.arange(-4, 5)))
    assert (np.delete(found, np.arange(6, 15)) == LEAST).all()


def test_several_modes_have_each_their_own_slope():
    """Where all else is impossible: by how far it is to the nearest one."""
    sensor = Table(ROW, 3)
    sensor.values[0] = 0.0
    modes = np.array([2, 3, 17, 30])
    sensor.values[0, modes] = 1.0
    low = from_afar(sensor, domain(PreciseGreyTile(ROW, error=0)).whole)
    apart = np.abs(np.arange(31)[:, None] - modes).min(axis=1)
    found = low.log_likelihood(tiles(ROW), np.array([0]))
    assert found == pytest.approx(-EFOLDS / 31.0 * apart)


def test_the_ranking_of_the_paper():
    """p(41 | 41) > p(41 | 60) > p(41 | 80) > 0, and p(41 | x₁) > p(41 | x₂) for 41 < x₁ < x₂; a
    sensor that errs by a tile knows 40 … 42 equally well.
    """
    sensor = PreciseGreyTile((128,), error=1)
    z, x = np.array([41]), tiles((128,))
    low = from_afar(sensor, domain(sensor).whole)
    p = np.exp(low.log_likelihood(x, z))
    assert p[41] > p[60] > p[80] > 0.0
    assert p[40] == p[41] == p[42] == p.max()
    assert (np.diff(p[42:]) < 0.0).all()
    assert (np.diff(p[:41]) > 0.0).all()
    assert np.exp(sensor.log_likelihood(x, z))[[60, 80]].tolist() == [0.0, 0.0]
    assert p[42] / p[42 + 64] == pytest.approx(np.exp(0.5 * EFOLDS))


def test_from_afar_looks_over_the_region_and_no_farther():
    """Over its width along each axis the likelihood falls by the same."""
    for shape, space in ((ROW, LINE), (PLANE_SHAPE, PLANE)):
        region = domain(PreciseGreyTile(shape)).whole.halves(0)[0]
        assert region.space == space
        low = from_afar(PreciseGreyTile(shape), region)
        reach = np.floor(region.sides)
        assert low.offsets.shape[1] == np.prod(2 * reach + 1) - 1
        assert np.array_equal(np.abs(low.offsets).max(axis=1), reach)
        along = low.offsets[0] == 1.0
        along &= (low.offsets[1:] == 0.0).all(axis=0)
        assert low.falls[along] == pytest.approx([EFOLDS / region.sides[0]])


def test_any_sensor_can_be_seen_from_afar():
    """Two landmarks' ranges: the modes are the two points where the circles meet, and it falls as
    the power of p does.
    """
    sensor = LandmarkModel(Landmarks.numbered([[0.0, 0.0], [4.0, 0.0]]))
    z = Sightings(0.0, np.array([0, 1]), np.array([2.5, 2.5]), np.full(2, np.nan))
    grid = np.stack(np.meshgrid(np.linspace(-1, 5, 61), np.linspace(-4, 4, 81))).reshape(2, -1)
    p, low = sensor.log_likelihood(grid, z), LowResolution(sensor, 0.3)
    found = low.log_likelihood(grid, z)
    assert np.array_equal(found == found.max(), p == p.max())
    assert found == pytest.approx(0.3 * p)
    assert grid[:, p == p.max()].T.round(9).tolist() in (
        [[2.0, -1.5], [2.0, 1.5]],
        [[2.0, -1.6], [2.0, 1.6]],
    )


@every_way
def test_what_it_says_of_itself_and_whatever_the_chunk(virtual):
    sensor, z, x = Table(PLANE_SHAPE, 4), np.array([2]), tiles(PLANE_SHAPE)
    low = virtual(sensor) if virtual is not VIRTUAL["region"] else VIRTUAL["near"](sensor)
    assert low.readings(z) == low.power * 3.0
    assert low.beams(z) == 2 * (1 + low.offsets.shape[1])
    assert low.source(z) == "table"
    assert (low.explained(x, z) == 0.25).all()
    before = x.copy()
    parts = [low.log_likelihood(x[:, a:b], z) for a, b in ((0, 1), (1, 20), (20, 63))]
    assert np.array_equal(low.log_likelihood(x, z), np.concatenate(parts))
    assert np.array_equal(x, before)


def test_a_sensor_that_is_left_out_tells_nothing():
    sensor, z, x = Table(ROW, 4), np.array([2]), tiles(ROW)
    nothing = LeftOut(sensor)
    assert (nothing.log_likelihood(x, z) == 0.0).all()
    assert np.isnan(nothing.explained(x, z)).all()
    assert (nothing.readings(z), nothing.beams(z), nothing.source(z)) == (3.0, 0, "table")
