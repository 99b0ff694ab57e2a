"""The direction of an object in an image: p(z | x) over the image and "not seen" against a camera
that is simulated by itself.
"""

import numpy as np
import pytest
from scipy.stats import binomtest, chisquare, norm

from mcloc.errors import ConfigError
from mcloc.sensors.image_bearing import ImageBearing

SHARP = ImageBearing(noise=0.02, field_of_view=1.0, p_detect=0.9)
POOR = ImageBearing(noise=0.3, field_of_view=1.0, p_detect=0.8)
PLACES = {
    "in the middle": (3.0, 0.1, -0.2),
    "at the edge": (2.0, 1.05, 0.3),
    "beside": (2.0, -1.6, 0.1),
    "behind": (-2.0, 0.1, 0.1),
}
every_place = pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
every_sensor = pytest.mark.parametrize("sensor", [SHARP, POOR], ids=["sharp", "poor"])
BLOCKS = 6  # of a χ² test, along each axis
NODES = 40  # along each axis within a block


def simulated(sensor, place, n, seed):
    """(m, 2): what was seen, of n looks."""
    rng = np.random.default_rng(seed)
    if place[0] <= 0.0:
        return np.empty((0, 2))
    width = 2.0 * np.tan(0.5 * sensor.field_of_view)
    z = np.array(place[1:]) / place[0] + sensor.noise * width * rng.standard_normal((n, 2))
    inside = (np.abs(z) <= 0.5 * width * np.array([1.0, sensor.aspect])).all(axis=1)
    return z[inside & (rng.random(n) < sensor.p_detect)]


def over_the_image(sensor, place):
    """(BLOCKS, BLOCKS): the probability of a z in each block of the image, by the midpoint rule."""
    x, count = np.array(place)[:, None], BLOCKS * NODES
    axes = [half * ((2.0 * np.arange(count) + 1.0) / count - 1.0) for half in sensor.half]
    p = [[np.exp(sensor.log_likelihood(x, np.array([a, b]))[0]) for b in axes[1]] for a in axes[0]]
    area = 4.0 * sensor.half[0] * sensor.half[1] / count**2
    return area * np.array(p).reshape(BLOCKS, NODES, BLOCKS, NODES).sum(axis=(1, 3))


@every_sensor
@every_place
def test_it_is_a_probability_over_the_image_and_not_seen(sensor, place):
    missed = np.exp(sensor.log_likelihood(np.array(place)[:, None], None)[0])
    assert over_the_image(sensor, place).sum() + missed == pytest.approx(1.0, abs=1e-3)


@every_sensor
@every_place
def test_simulated_looks_have_this_distribution(sensor, place):
    n = 4000
    z = simulated(sensor, place, n, 7)
    missed = float(np.exp(sensor.log_likelihood(np.array(place)[:, None], None)[0]))
    assert binomtest(n - len(z), n, min(missed, 1.0)).pvalue > 1e-4
    expected = n * over_the_image(sensor, place)
    edges = [np.linspace(-half, half, BLOCKS + 1) for half in sensor.half]
    observed = np.histogram2d(*z.T, bins=edges)[0]
    often = expected > 5.0
    assert observed[~often].sum() <= expected[~often].sum() + 4.5 * np.sqrt(n) + 5.0
    if often.sum() > 1:
        share = observed[often].sum() / expected[often].sum()
        assert chisquare(observed[often], share * expected[often]).pvalue > 1e-4


def test_range_is_never_measured():
    x = np.outer([1.0, 0.2, -0.1], [1.0, 2.0, 30.0])
    for z in (np.array([0.1, 0.0]), None):
        log_p = SHARP.log_likelihood(x, z)
        assert log_p == pytest.approx(log_p[0])


def test_a_miss_says_that_the_object_is_not_in_view():
    x = np.array(list(PLACES.values())).T
    missed = np.exp(SHARP.log_likelihood(x, None))
    assert missed[0] == pytest.approx(0.1)
    beyond = norm.sf((np.tan(0.5) - 0.525) / (0.04 * np.tan(0.5)))
    assert missed[1] == pytest.approx(0.1 + 0.9 * beyond, abs=1e-6)
    assert missed[2:] == pytest.approx(1.0)


def test_a_miss_that_hardly_can_be_keeps_its_figure():
    """The tails are summed, not taken from 1: 9 deviations away it is 2 · 10⁻¹⁹ each side."""
    sensor = ImageBearing(noise=1.0 / 18.0, aspect=10.0, p_detect=1.0)
    log_p = sensor.log_likelihood(np.array([[2.0], [0.0], [0.0]]), None)
    assert log_p == pytest.approx(np.log(2.2572e-19), abs=1e-3)


@pytest.mark.parametrize("z", [np.array([0.1, 0.2]), None, np.array([5.0, 0.0])])
def test_a_number_or_minus_infinity_whatever_the_chunk(z):
    x = np.random.default_rng(2).normal(0.0, 3.0, (3, 200))
    x[0, :3] = 0.0, -1e-300, 1e-300
    whole = POOR.log_likelihood(x, z)
    assert whole.shape == (200,)
    assert not np.isnan(whole).any()
    assert (whole < np.inf).all()
    parts = [POOR.log_likelihood(x[:, a:b], z) for a, b in ((0, 3), (3, 200))]
    assert np.array_equal(whole, np.concatenate(parts))
    assert POOR.readings(z) == POOR.beams(z) == 1
    assert POOR.source(z) == "camera"


def test_what_is_explained():
    x = np.array([[2.0, 2.0, -2.0], [0.2, 0.9, -0.2], [0.0, 0.0, 0.0]])
    assert SHARP.explained(x, np.array([0.1, 0.0])).tolist() == [1.0, 0.0, 0.0]
    assert np.isnan(SHARP.explained(x, None)).all()


@pytest.mark.parametrize("wrong", [{"noise": 0.0}, {"field_of_view": 3.2}, {"p_detect": 1.1}])
def test_what_cannot_be_is_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        ImageBearing(**wrong)
