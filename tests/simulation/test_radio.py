"""Radio beacons of a world, and ranges to them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest, kstest

from mcloc.errors import ConfigError
from mcloc.maps.beacons import Beacons
from mcloc.registry import ParameterError
from mcloc.simulation import Radio, office_world
from mcloc.simulation.wall_places import wall_places

PLACES = np.array([[0.0, 0.0, 2.0], [9.0, -3.0, 2.5], [4.0, 12.0, 1.0]])
BEACONS = Beacons(["1", "2", "3"], PLACES)
RNG = np.random.default_rng
N = 3000


def measured(radio: Radio, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Ranges (N, 3) and the true distances, by the definition."""
    poses = RNG(0).uniform([-5.0, -5.0, -np.pi], [5.0, 5.0, np.pi], (N, 3))
    readings = list(radio.measure(BEACONS, np.arange(float(N)), poses, RNG(seed)))
    assert [reading.t for reading in readings] == list(range(N))
    assert all(reading.antenna.tolist() == list(radio.antenna) for reading in readings)
    ahead, left, up = radio.antenna
    d = np.empty((N, 3))
    for k, (x, y, theta) in enumerate(poses):
        cos, sin = np.cos(theta), np.sin(theta)
        antenna = np.array([x + cos * ahead - sin * left, y + sin * ahead + cos * left, up])
        d[k] = np.linalg.norm(PLACES - antenna, axis=1)
    return np.array([reading.range for reading in readings]), d


EXACT = Radio(
    sigma=0.0, sigma_bias=0.0, p_late=0.0, p_outlier=0.0, missing=0.0, antenna=(0.3, -0.2, 0.7)
)


def test_without_errors_a_range_is_the_distance_from_the_antenna() -> None:
    ranges, d = measured(EXACT)
    np.testing.assert_allclose(ranges, d, atol=1e-9)
    ranges, d = measured(replace(EXACT, range_max=8.0))
    np.testing.assert_array_equal(np.isnan(ranges), d > 8.0)


def test_the_bias_of_a_beacon_stays_and_the_noise_does_not() -> None:
    ranges, d = measured(replace(EXACT, sigma=0.1, sigma_bias=0.5))
    error = ranges - d
    bias = error.mean(axis=0)
    assert (np.abs(bias) > 5.0 * 0.1 / np.sqrt(N)).all()
    for of_beacon in error.T:
        assert kstest((of_beacon - of_beacon.mean()) / 0.1, "norm").pvalue > 1e-3
    other, d = measured(replace(EXACT, sigma=0.1, sigma_bias=0.5), seed=2)
    assert (np.abs((other - d).mean(axis=0) - bias) > 0.02).all()


def test_shares_are_late_anything_or_missing() -> None:
    ranges, d = measured(replace(EXACT, p_late=0.2, late=2.0, p_outlier=0.1, missing=0.3))
    came, error = np.isfinite(ranges), (ranges - d).ravel()
    exact = np.abs(error) < 1e-9
    assert binomtest(int((~came).sum()), came.size, 0.3).pvalue > 1e-3
    assert binomtest(int(exact.sum()), int(came.sum()), 0.7).pvalue > 1e-3
    late, d = measured(replace(EXACT, p_late=0.9, late=2.0))
    delay = (late - d).ravel()
    assert kstest(delay[delay > 1e-9], "expon", args=(0.0, 2.0)).pvalue > 1e-3
    wrong, _ = measured(replace(EXACT, p_outlier=0.9, range_max=40.0))
    off = np.abs(wrong - d) > 1e-9
    assert kstest(wrong[off], "uniform", args=(0.0, 40.0)).pvalue > 1e-3


def test_beacons_hang_on_walls() -> None:
    placed = Radio(beacons=6, height=1.8).placed(office_world(1), RNG(4))
    assert placed.names == ("1", "2", "3", "4", "5", "6")
    assert (placed.places[:, 2] == 1.8).all()
    np.testing.assert_array_equal(placed.places[:, :2], wall_places(office_world(1), 6, RNG(4)))


def test_what_cannot_be() -> None:
    with pytest.raises(ParameterError, match="beacons = 0"):
        Radio(beacons=0)
    with pytest.raises(ParameterError, match="p_late"):
        Radio(p_late=0.6, p_outlier=0.5)
    with pytest.raises(ConfigError, match="antenna"):
        Radio(antenna=(0.0, np.nan, 0.0))
