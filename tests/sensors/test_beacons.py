"""Ranges to radio beacons: a density over ranges and none, tempered by how beacons have done."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import expon, kstest, t

from mcloc.errors import ConfigError
from mcloc.events import BeaconRanges
from mcloc.maps.beacons import Beacons
from mcloc.sensors import RANGINGS
from mcloc.sensors.beacons import BeaconModel

PLACES = np.array([[0.0, 3.0, 2.0], [4.0, -1.0, 0.5]])
BEACONS = Beacons(["a", "b"], PLACES)
MODELS = [
    {},
    {"range_max": 6.0, "nu": 1.0, "p_late": 0.3, "late": 3.0},
    {"sigma": 0.5, "sigma_bias": 0.0, "p_outlier": 0.4, "range_max": 2.0},
]
DISTANCES = [0.0, 0.1, 1.0, 1.9, 5.5, 8.0]


def model(**settings):
    return RANGINGS.make("beacons", BEACONS, **settings)


def reading(*ranges, beacon=None, **more):
    which = np.arange(len(ranges)) if beacon is None else np.array(beacon)
    return BeaconRanges(0.0, which, np.array(ranges), **more)


def drawn(m, d, n, rng):
    """Ranges by the story that the model tells, NaN for none; by SciPy's distributions."""
    why = rng.random(n)
    near = d + m.scale * t.rvs(m.nu, size=n, random_state=rng)
    late = d + expon.rvs(scale=m.late, size=n, random_state=rng)
    anything = rng.uniform(0.0, m.range_max, n)
    r = np.where(why < m.p_outlier, anything, np.where(why < m.p_outlier + m.p_late, late, near))
    return np.where((r > 0.0) & (r <= m.range_max), r, np.nan)


@pytest.mark.parametrize("settings", MODELS)
@pytest.mark.parametrize("d", DISTANCES)
def test_ranges_and_none_sum_to_one(settings, d):
    m = model(**settings)
    knots = [d - 1e-9, d, *(d + m.scale * np.array([-30, -5, -1, 1, 5, 30]))]
    edges = np.unique(np.clip([0.0, *knots, m.range_max], 0.0, m.range_max))
    measured = sum(
        quad(lambda r: float(m.density(r, np.array(d))), a, b, epsabs=1e-12)[0]
        for a, b in pairwise(edges)
    )
    assert measured + float(m.no_range(np.array(d))) == pytest.approx(1.0, abs=1e-7)


@pytest.mark.parametrize("settings", MODELS)
@pytest.mark.parametrize("d", [0.3, 1.5])
def test_what_its_story_draws_has_its_density(settings, d):
    """Kolmogorov and Smirnov of 20,000 ranges; the number of none by 4.5 deviations."""
    m, n = model(**settings), 20_000
    r = drawn(m, d, n, np.random.default_rng(7))
    none = float(m.no_range(np.array(d)))
    assert abs(np.isnan(r).sum() - n * none) <= 4.5 * np.sqrt(n * none * (1.0 - none)) + 1.0
    r = np.sort(r[~np.isnan(r)])
    fine = np.unique(np.concatenate([np.linspace(1e-9, m.range_max, 400_001), [d - 1e-9, d]]))
    p = m.density(fine, np.array(d))
    mass = np.concatenate([[0.0], np.cumsum(0.5 * (p[1:] + p[:-1]) * np.diff(fine))])
    assert kstest(r, lambda x: np.interp(x, fine, mass / mass[-1])).pvalue > 1e-3


def test_failures_are_as_frequent_as_it_says():
    m, n = model(), 100_000
    r = drawn(m, 20.0, n, np.random.default_rng(3))
    failed = np.mean(np.abs(r - 20.0) > 3.0 * m.scale)
    assert failed == pytest.approx(m.p_failure, abs=4.5 * np.sqrt(m.p_failure / n))


def test_late_ranges_are_likelier_than_early_ones():
    m = model()
    late, early = m.density(np.array([7.0, 3.0]), np.array(5.0))
    assert late > 5.0 * early


def test_is_the_product_over_its_ranges_in_space():
    """Distances from the antenna, which turns with the robot, to the beacon, heights included."""
    m, rng = model(), np.random.default_rng(1)
    x = np.stack([rng.uniform(-5, 5, 50), rng.uniform(-5, 5, 50), rng.uniform(-3, 3, 50)])
    antenna = np.array([0.3, -0.2, 1.1])
    z = reading(4.0, 6.5, antenna=antenna, novelty=0.4)
    expected = np.zeros(50)
    for k, (px, py, theta) in enumerate(x.T):
        turn = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
        at = np.append([px, py] + turn @ antenna[:2], antenna[2])
        for beacon, r in enumerate(z.range):
            d = np.linalg.norm(PLACES[beacon] - at)
            p = float(m.density(r, np.array(d))) / float(m.density(r, np.array(r)))
            expected[k] += 0.4 * np.log(p)
    assert m.log_likelihood(x, z) == pytest.approx(expected, abs=1e-12)
    assert m.readings(z) == pytest.approx(0.8)
    assert m.beams(z) == 2


def test_a_perfect_range_has_zero_whatever_its_beacon():
    m, x = model(), np.array([[1.0], [2.0], [0.5]])
    d = [float(m.distance(x, k, np.zeros(3))[0]) for k in range(2)]
    assert m.log_likelihood(x, reading(*d)) == pytest.approx(0.0)
    assert m.explained(x, reading(*d)) == pytest.approx(1.0)
    assert m.explained(x, reading(d[0], d[1] + 3.1 * m.scale)) == pytest.approx(0.5)


@pytest.mark.parametrize("none", [np.nan, np.inf, 0.0, -1.0, 50.1])
def test_what_is_no_range_says_nothing(none):
    m, x = model(), np.zeros((3, 4))
    assert np.array_equal(m.log_likelihood(x, reading(none)), np.zeros(4))
    assert 0.0 < m.readings(reading(none)) < 1e-6
    assert np.isnan(m.explained(x, reading(none))).all()
    both = reading(none, 4.0)
    assert np.array_equal(m.log_likelihood(x, both), m.log_likelihood(x, reading(4.0, beacon=[1])))


def test_a_beacon_that_fails_too_often_counts_less():
    m = model()

    def trust_of(heard, failed, **more):
        return float(m.trust(reading(1.0, heard=[heard], failed=[failed], **more))[0])

    assert trust_of(0.0, 0.0) == 1.0
    assert trust_of(100.0, m.p_failure * 100.0) == 1.0
    assert trust_of(1000.0, 380.0) == pytest.approx(m.p_failure / 0.38, rel=0.02)
    # Where most sensors fail, it is the robot that is wrong.
    assert trust_of(100.0, 80.0, usual=0.8) == 1.0
    # Beside a laser a beacon has to earn its trust.
    assert trust_of(0.0, 0.0, alone=False) == 0.5
    assert trust_of(100.0, 0.0, alone=False) == 1.0
    x, good = np.zeros((3, 1)), reading(4.0, 6.5)
    bad = reading(4.0, 6.5, heard=np.array([50.0, 50.0]), failed=np.array([20.0, 0.0]))
    trust = trust_of(50.0, 20.0)
    alone = [m.log_likelihood(x, reading(r, beacon=[k])) for k, r in enumerate(good.range)]
    assert m.log_likelihood(x, bad) == pytest.approx(trust * alone[0] + alone[1])
    assert m.readings(bad) == pytest.approx(trust + 1.0)


def test_what_cannot_be_is_refused():
    with pytest.raises(ConfigError, match="beacon 2, but there are 2"):
        model().log_likelihood(np.zeros((3, 1)), reading(1.0, beacon=[2]))
    with pytest.raises(ConfigError, match="p_late \\+ p_outlier must be below 1"):
        BeaconModel(BEACONS, p_late=0.6, p_outlier=0.5)
    with pytest.raises(ConfigError, match="whole numbers from 0 on"):
        reading(1.0, beacon=[-1])
    with pytest.raises(ConfigError, match="of a beacon each"):
        BeaconRanges(0.0, np.array([0, 1]), np.array([1.0]))
