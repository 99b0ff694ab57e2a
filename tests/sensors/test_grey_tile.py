"""Grey values of tiles: the paper's numbers, sums over all values, and simulated values against the
likelihood.
"""

from fractions import Fraction

import numpy as np
import pytest
from scipy.stats import chisquare

from mcloc.errors import ConfigError
from mcloc.sensors.grey_tile import GreyTile, PreciseGreyTile

SHAPE = (7, 4)
TILES = np.indices(SHAPE).reshape(2, -1).astype(float)
VALUES = [np.array(z) for z in np.ndindex(*SHAPE)]  # in the order of TILES
SENSORS = {"grey": GreyTile, "precise": PreciseGreyTile}
every_sensor = pytest.mark.parametrize("kind", SENSORS.values(), ids=SENSORS)


def p(sensor, g, x):
    """p(g | x) on a row."""
    return np.exp(sensor.log_likelihood(np.array([[float(x)]]), np.array([g]))[0])


@pytest.mark.parametrize(("x", "percent"), [(7, 6), (3, 27), (9, 5), (2, 14)])
def test_the_likelihoods_of_the_paper(x, percent):
    """p(3 | x) on 11 tiles: it gives percents, all of them rounded up."""
    assert np.ceil(100.0 * p(GreyTile((11,)), 3, x)) == percent


def test_r_is_one_in_distance_plus_one():
    """Every p(g | x) on 11 tiles, in fractions."""
    for x in range(11):
        r = [Fraction(1, 1 + abs(g - x)) for g in range(11)]
        expected = [float(value / sum(r)) for value in r]
        assert [p(GreyTile((11,)), g, x) for g in range(11)] == pytest.approx(expected)


PRECISE = {  # (error, g, x): p(g | x) on 128 tiles
    **{(1, 41, 80): 0.0, (1, 41, 40): 1 / 3, (1, 39, 40): 1 / 3, (1, 42, 40): 0.0},
    **{(1, 0, 0): 1 / 2, (1, 126, 127): 1 / 2, (5, 45, 40): 1 / 11, (5, 0, 2): 1 / 8},
    **{(0, 40, 40): 1.0, (0, 41, 40): 0.0, (1000, 3, 90): 1 / 128},
}


@pytest.mark.parametrize(("case", "expected"), PRECISE.items())
def test_a_precise_sensor_knows_the_tile_but_for_its_error(case, expected):
    """The paper's errs by 1: p(41 | 80) = 0."""
    error, g, x = case
    assert p(PreciseGreyTile((128,), error=error), g, x) == pytest.approx(expected)


@every_sensor
def test_it_is_a_probability_over_all_values(kind):
    total = sum(np.exp(kind(SHAPE).log_likelihood(TILES, z)) for z in VALUES)
    assert total == pytest.approx(1.0)


@every_sensor
def test_channels_are_independent(kind):
    for z in VALUES:
        along = [
            kind(SHAPE[k : k + 1]).log_likelihood(TILES[k, None], z[k : k + 1]) for k in range(2)
        ]
        assert kind(SHAPE).log_likelihood(TILES, z) == pytest.approx(along[0] + along[1])


@every_sensor
@pytest.mark.parametrize("x", [(0.0, 1.0), (4.0, 3.0)])
def test_simulated_values_have_this_distribution(kind, x):
    sensor, rng, n = kind(SHAPE), np.random.default_rng(5), 6000
    observed = np.zeros(SHAPE)
    for _ in range(n):
        observed[tuple(sensor.sample(np.array(x), rng))] += 1
    state = np.array(x)[:, None]
    expected = n * np.exp([sensor.log_likelihood(state, z)[0] for z in VALUES])
    possible = expected > 0.0
    assert observed.ravel()[~possible].sum() == 0
    assert chisquare(observed.ravel()[possible], expected[possible]).pvalue > 1e-4


@every_sensor
def test_what_is_no_tile_or_no_value_is_impossible(kind):
    sensor = kind(SHAPE)
    outside = np.array([[-1.0, 7.0, 2.5, 0.0], [0.0, 0.0, 0.0, 4.0]])
    assert (sensor.log_likelihood(outside, np.array([0, 0])) == -np.inf).all()
    for z in ((-1, 0), (0, 4), (7, 3)):
        assert (sensor.log_likelihood(TILES, np.array(z)) == -np.inf).all()


def test_what_is_explained():
    """A value is half as likely as the true one at a distance of one tile."""
    x = np.array([[3.0, 3.0, 3.0, 7.0], [0.0, 1.0, 3.0, 0.0]])
    z = np.array([4, 0])
    assert GreyTile(SHAPE).explained(x, z).tolist() == [1.0, 1.0, 0.5, 0.5]
    precise = PreciseGreyTile(SHAPE, error=2)
    assert precise.explained(x, np.array([5, 3])).tolist() == [0.5, 1.0, 1.0, 0.0]


@every_sensor
def test_one_reading_a_channel_whatever_the_chunk(kind):
    sensor, z = kind(SHAPE), np.array([3, 1])
    assert sensor.readings(z) == sensor.beams(z) == 2
    assert sensor.source(z) == "grey"
    parts = [sensor.log_likelihood(TILES[:, a:b], z) for a, b in ((0, 1), (1, 9), (9, 28))]
    assert np.array_equal(sensor.log_likelihood(TILES, z), np.concatenate(parts))


@pytest.mark.parametrize("error", [-1, 0.5, np.inf])
def test_an_error_is_a_whole_number_of_tiles(error):
    with pytest.raises(ConfigError, match="error"):
        PreciseGreyTile(SHAPE, error=error)


@every_sensor
@pytest.mark.parametrize("shape", [(), (0,), (3, -1)])
def test_a_shape_that_cannot_be_is_refused(kind, shape):
    with pytest.raises(ConfigError, match="tiles need"):
        kind(shape)
