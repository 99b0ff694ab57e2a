"""The index of a ceiling: what it draws is what it says, everywhere, and near the truth."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.events import Image
from mcloc.geometry import between, compose, wrap
from mcloc.maps.mosaic import Mosaic
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.samplers.ceiling_index import CeilingIndex
from mcloc.sensors import CAMERAS

ORIGIN = np.array([-1.0, 2.0, 0.6])
POSE = compose(ORIGIN, [3.3, 2.2, 0.9])


def grid():
    cells = np.full((50, 60), FREE, dtype=np.int8)
    cells[:, :3] = OCCUPIED
    cells[20:25, 10:30] = OCCUPIED
    return OccupancyGrid(cells, 0.1, ORIGIN)


def mosaic(unknown=False):
    """5 m × 4 m: some of the floor has no ceiling."""
    image = gaussian_filter(np.random.default_rng(0).random((80, 100)), 5)
    image = 0.2 + 0.6 * (image - image.min()) / np.ptp(image)
    if unknown:
        image[10:20, 70:90] = np.nan
    return Mosaic(image, 0.05, ORIGIN)


def image_at(m, pose):
    off = 0.1 * (np.arange(15) - 7.0)
    ahead, left = np.meshgrid(-off, -off, indexing="ij")
    local = np.column_stack([ahead.ravel(), left.ravel(), np.zeros(225)])
    return Image(0.0, m.at(np.ascontiguousarray(compose(pose, local).T)).reshape(15, 15))


def index(m=None, name="ceiling-patch", **settings):
    return CeilingIndex(CAMERAS.make(name, m or mosaic()), FreeSpace(grid()), **settings)


@pytest.mark.parametrize("unknown", [False, True])
@pytest.mark.parametrize("name", list(CAMERAS))
def test_the_density_integrates_to_1(name, unknown):
    """By uniform poses around all that it can hold; 4 standard errors, and no more than 4 %."""
    m = mosaic(unknown)
    q = index(m, name).given(image_at(m, POSE), Draws(1))
    n = 800_000
    low, high = np.array([-0.5, -0.5, -np.pi]), np.array([6.5, 5.5, np.pi])
    local = np.random.default_rng(1).uniform(low, high, (n, 3))
    p = np.exp(q.log_density(np.ascontiguousarray(compose(ORIGIN, local).T)))
    volume = np.prod(high - low)
    error = 4.0 * volume * p.std() / np.sqrt(n)
    assert error < 0.04
    assert volume * p.mean() == pytest.approx(1.0, abs=error)


def test_samples_are_as_dense_as_the_density_says():
    """Shares of samples in blocks of poses against their integrals; χ² of 5 · 4 · 6 blocks."""
    m, n = mosaic(), 40_000
    q = index(m).given(image_at(m, POSE), Draws(1))
    x = q.sample(Draws(2), 0, n)
    assert (np.abs(x[2]) <= np.pi).all()

    def block(poses):
        inside = between(ORIGIN, poses.T)
        column, row = (np.floor(inside[:, k] / 1.25).astype(int) for k in (0, 1))
        heading = np.floor((wrap(inside[:, 2]) + np.pi) / (2 * np.pi) * 6).clip(0, 5).astype(int)
        return (row.clip(0, 3) * 5 + column.clip(0, 4)) * 6 + heading

    many = np.random.default_rng(3).uniform((0, 0, -np.pi), (6.0, 5.0, np.pi), (1_000_000, 3))
    poses = np.ascontiguousarray(compose(ORIGIN, many).T)
    p = np.exp(q.log_density(poses)) * 6.0 * 5.0 * 2.0 * np.pi / len(many)
    expected = np.bincount(block(poses), p, 120) * n
    found = np.bincount(block(x), minlength=120)
    assert expected.sum() == pytest.approx(n, rel=0.01)
    full = expected > 20
    chi2 = np.sum((found[full] - expected[full]) ** 2 / expected[full])
    assert full.sum() > 60
    assert chi2 < full.sum() + 5.0 * np.sqrt(2.0 * full.sum())


def test_it_is_positive_wherever_a_robot_can_be():
    places = FreeSpace(grid())
    x = places.sample(Draws(5), 0, 5000)
    m = mosaic()
    for z in (image_at(m, POSE), Image(0.0, np.zeros((15, 15)))):
        q = index(m).given(z, Draws(1))
        assert (q.log_density(x) >= places.log_density(x) + np.log(0.1) - 1e-9).all()
        assert np.isfinite(q.log_density(q.sample(Draws(6), 0, 5000))).all()


@pytest.mark.parametrize("pixels", [np.zeros((15, 15)), np.full((15, 15), np.nan)])
def test_of_a_covered_lens_it_is_uniform(pixels):
    places = FreeSpace(grid())
    x = places.sample(Draws(5), 0, 100)
    q = index().given(Image(0.0, pixels), Draws(1))
    assert q.log_density(x) == pytest.approx(places.log_density(x))


@pytest.mark.parametrize("name", list(CAMERAS))
def test_it_finds_the_place_better_than_chance(name):
    """Over poses that the camera has been at; the mean of log q̄ / U at the truth."""
    m, places = mosaic(), FreeSpace(grid())
    found, rng = [], np.random.default_rng(7)
    for seed in range(40):
        pose = compose(ORIGIN, rng.uniform((1.0, 1.0, -3.0), (4.0, 3.0, 3.0)))
        x = np.ascontiguousarray(pose[:, None])
        if places.log_density(x)[0] == -np.inf:
            continue
        q = index(m, name).given(image_at(m, pose), Draws(seed))
        found.append(float(q.log_density(x)[0] - places.log_density(x)[0]))
    assert len(found) > 20
    assert np.mean(found) > 1.5
    assert np.mean(np.array(found) > 0.0) > 0.9


def test_samples_do_not_depend_on_chunks_and_pi_is_that_of_many_poses():
    m = mosaic()
    q = index(m).given(image_at(m, POSE), Draws(1))
    whole = q.sample(Draws(2), 0, 300)
    parts = [q.sample(Draws(2), 0, 7), q.sample(Draws(2), 7, 293)]
    assert np.array_equal(whole, np.concatenate(parts, axis=1))
    n, rng = 400_000, np.random.default_rng(8)
    local = rng.uniform((0, 0, -np.pi), (6.0, 5.0, np.pi), (n, 3))
    p = np.exp(q.fit(np.ascontiguousarray(compose(ORIGIN, local).T)))
    exact = np.log(60.0 * np.pi * p.mean())
    assert q.log_pi == pytest.approx(exact, abs=0.15)


def test_a_mosaic_over_no_floor_leaves_the_uniform_density():
    m = Mosaic(mosaic().image, 0.05, np.array([100.0, 100.0, 0.0]))
    places = FreeSpace(grid())
    q = index(m).given(image_at(mosaic(), POSE), Draws(1))
    x = places.sample(Draws(1), 0, 50)
    assert q.log_density(x) == pytest.approx(places.log_density(x))


def test_an_image_smaller_than_the_reach_is_compared_by_its_brightness_alone():
    """Its density is that of the formula without gradients: alike for all headings, and for places
    by how bright they are.
    """
    places = FreeSpace(grid())
    model = CAMERAS.make("ceiling-brightness", mosaic())
    index = CeilingIndex(model, places)
    q = index.given(Image(0.0, np.full((5, 5), 0.3)), Draws(1))
    x = places.sample(Draws(1), 0, 2000)
    x = np.ascontiguousarray(x[:, np.isfinite(mosaic().at(x))])
    turned = x + np.array([[0.0], [0.0], [1.0]])
    assert q.log_density(turned) == pytest.approx(q.log_density(x))
    off = np.abs(mosaic().averaged(index.radius).at(x) - 0.3)
    density = np.exp(q.log_density(x))
    near, far = (density[off <= np.quantile(off, 0.2)], density[off >= np.quantile(off, 0.8)])
    assert np.quantile(off, 0.8) > 0.1  # or the comparison says nothing
    assert near.mean() > 1.4 * far.mean()  # some exp(-½ (0.16 / 0.12)²), and the floor
