"""An EKF with landmarks: Jacobians by differences, one step against a lattice, and gates."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mcloc.density import Gaussian
from mcloc.draws import Draws
from mcloc.errors import ConfigError
from mcloc.events import UNKNOWN, Sightings
from mcloc.filters.catalog import Composition
from mcloc.filters.landmark_ekf import LandmarkEKF, expected_sighting
from mcloc.geometry import compose, wrap
from mcloc.maps.landmarks import Landmarks, open_floor
from mcloc.sensors.landmarks import LandmarkModel

PLACES = np.array([[4.0, 1.0], [-2.0, 3.0], [1.0, -3.0]])
MARKS = Landmarks.numbered(PLACES)
MODEL = LandmarkModel(MARKS, sigma_range=0.1, sigma_relative=0.0, p_outlier=1e-6)
MOUNT = np.array([0.3, -0.2, 0.8])
POSE = np.array([0.4, 0.3, 3.0])
PRIOR = Gaussian(
    np.add(POSE, [0.05, -0.04, 0.03]),
    np.array([[0.01, 0.002, 0.001], [0.002, 0.008, -0.001], [0.001, -0.001, 0.004]]),
)


def seen_from(pose, landmarks, mount):
    sensor = compose(pose, mount)
    dx, dy = (PLACES[landmarks] - sensor[:2]).T
    bearing = wrap(np.arctan2(dy, dx) - sensor[2])
    return Sightings(0.0, landmarks, np.hypot(dx, dy), bearing, mount=mount)


@pytest.mark.parametrize("landmark", [0, 1, 2])
def test_jacobians_are_those_of_differences(landmark):
    h, jacobian = expected_sighting(POSE, MOUNT, PLACES[landmark])
    z = seen_from(POSE, [landmark], MOUNT)
    assert h == pytest.approx([z.range[0], z.bearing[0]])
    for k in range(3):
        step = 1e-6 * np.eye(3)[k]
        up, down = (expected_sighting(POSE + s, MOUNT, PLACES[landmark])[0] for s in (step, -step))
        difference = np.array([up[0] - down[0], float(wrap(up[1] - down[1]))]) / 2e-6
        assert jacobian[:, k] == pytest.approx(difference, abs=1e-6)


def test_the_posterior_is_that_of_a_lattice():
    """Mean and covariance of p(z | x) N(x; prior) over ± 4.5 deviations around both: it is nearly
    Gaussian for deviations as small as these.
    """
    z = seen_from(POSE, [0, 1], MOUNT)
    after, looked = LandmarkEKF(MODEL, 3.0)(PRIOR, z)
    assert looked == 2
    half = 4.5 * np.sqrt(np.diag(PRIOR.covariance))
    axes = [
        m + h * np.linspace(-1.0, 1.0, n)
        for m, h, n in zip(PRIOR.mean, half, (61, 61, 81), strict=True)
    ]
    x = np.stack([v.ravel() for v in np.meshgrid(*axes, indexing="ij")])
    x[2] = wrap(x[2])
    log_p = MODEL.log_likelihood(x, z) + PRIOR.log_density(x)
    w = np.exp(log_p - log_p.max())
    w /= w.sum()
    e = x - PRIOR.mean[:, None]
    e[2] = wrap(e[2])
    mean = e @ w
    covariance = (e - mean[:, None]) * w @ (e - mean[:, None]).T
    sigma = np.sqrt(np.diag(covariance))
    off = after.mean - PRIOR.mean - mean
    off[2] = wrap(off[2])
    assert (np.abs(off) < 0.1 * sigma).all()
    assert np.abs(after.covariance - covariance).max() < 0.1 * covariance.max()
    assert (np.linalg.eigvalsh(after.covariance) > 0.0).all()


@pytest.mark.parametrize("none", ["range", "bearing"])
def test_half_a_sighting_is_used_as_far_as_it_goes(none):
    """As with a deviation without limits for what is missing."""
    z = seen_from(POSE, [0], MOUNT)
    z = replace(z, range=z.range + 0.03, bearing=z.bearing - 0.02)
    blind = {"range": {"sigma_range": 100.0}, "bearing": {"sigma_bearing": 2.0}}[none]
    wanted, _ = LandmarkEKF(replace(MODEL, **blind), 3.0)(PRIOR, z)
    found, _ = LandmarkEKF(MODEL, 3.0)(PRIOR, replace(z, **{none: np.array([math.nan])}))
    assert found.mean == pytest.approx(wanted.mean, abs=1e-4)
    assert found.covariance == pytest.approx(wanted.covariance, abs=1e-5)


def test_outliers_and_the_unknown_are_left_out():
    ekf = LandmarkEKF(MODEL, 3.0)
    z = seen_from(POSE, [0], MOUNT)
    for wrong in (
        replace(z, range=z.range + 2.0),
        replace(z, bearing=z.bearing + 1.5),
        replace(z, landmark=np.array([UNKNOWN])),
        replace(z, range=np.array([math.nan]), bearing=np.array([math.nan])),
    ):
        after, _ = ekf(PRIOR, wrong)
        assert np.array_equal(after.mean, PRIOR.mean)
        assert np.array_equal(after.covariance, PRIOR.covariance)
    turned = replace(z, bearing=z.bearing + 2.0 * np.pi)
    assert ekf(PRIOR, turned)[0].mean == pytest.approx(ekf(PRIOR, z)[0].mean)
    with pytest.raises(ConfigError, match="landmark 7"):
        ekf(PRIOR, replace(z, landmark=np.array([7])))


def test_the_filter_tracks_a_robot_that_turns_between_landmarks():
    """40 steps around a circle with noise as the models say: true within 4 deviations throughout,
    and better than its wheels.
    """
    rng = np.random.default_rng(2)
    kalman = Composition("kalman").build(open_floor(PLACES, 8.0, "floor"), MARKS)
    pose = wheels = np.array([0.0, -1.5, 0.0])
    bel = kalman.start(Gaussian(pose, np.diag([0.05, 0.05, 0.02]) ** 2), Draws(0))
    for step in range(1, 41):
        u = np.array([0.25, 0.02, 0.16])
        pose = compose(pose, u * (1.0 + 0.1 * rng.standard_normal(3)))
        wheels = compose(wheels, u)
        z = seen_from(pose, [step % 3, (step + 1) % 3], MOUNT)
        z = replace(
            z,
            range=z.range + np.hypot(0.05, 0.1 * z.range) * rng.standard_normal(2),
            bearing=z.bearing + 0.02 * rng.standard_normal(2),
        )
        bel, info = kalman.step(bel, u, z, Draws(1, step))
        off = bel.mean - pose
        off[2] = wrap(off[2])
        assert off @ np.linalg.solve(bel.covariance, off) < 16.0
        assert np.isfinite(info.log_evidence)
    assert np.hypot(*off[:2]) < 0.2 < np.hypot(*(wheels - pose)[:2])
