"""Places of an object from one look: a density that integrates to 1, a sampler that agrees with
it, and both against p(z | x) / π(z) on a grid and by importance sampling.
"""

import numpy as np
import pytest
from scipy.stats import chisquare, kstest

from mcloc.draws import Draws
from mcloc.environment import Box
from mcloc.errors import ConfigError
from mcloc.samplers.camera_ray import CameraRay
from mcloc.sensors.image_bearing import ImageBearing

BOX = Box((-1.0, -2.0, -1.5), (6.0, 3.0, 1.5))  # around the camera
AHEAD = Box((1.0, -2.0, -1.5), (6.0, 3.0, 1.5))
SHARP, POOR = (ImageBearing(noise=noise, field_of_view=1.2) for noise in (0.01, 0.3))
LOOKS = {
    "middle": (POOR, BOX, (0.05, -0.1)),
    "cut by the box": (POOR, AHEAD, (-0.45, 0.3)),
    "sharp": (SHARP, AHEAD, (0.05, -0.1)),
    "sharp, cut by the box": (SHARP, AHEAD, (-0.4, 0.3)),
    "not seen": (POOR, BOX, None),
    "not seen, sharp": (SHARP, AHEAD, None),
}
every_look = pytest.mark.parametrize(("sensor", "box", "z"), LOOKS.values(), ids=LOOKS)
N = 20_000


def density_of(sensor, box, z):
    z = None if z is None else np.array(z)
    return CameraRay(sensor, box).given(z, Draws(0)), z


def cells(box, shape, nodes):
    """(3, n): midpoints of a grid over the box, `nodes` along each axis of each cell; the volume
    of one; which cell each is in.
    """
    counts = np.multiply(shape, nodes)
    axes = [
        low + (high - low) * (np.arange(count) + 0.5) / count
        for low, high, count in zip(box.low, box.high, counts, strict=True)
    ]
    at = np.stack(np.meshgrid(*(np.arange(c) for c in counts), indexing="ij")).reshape(3, -1)
    x = np.stack([axis[i] for axis, i in zip(axes, at, strict=True)])
    return x, box.volume / counts.prod(), np.ravel_multi_index(at // nodes, shape)


@every_look
def test_it_integrates_to_1_and_is_p_over_pi(sensor, box, z):
    """On a grid of places; for a reading in depth, u and v: rays are thin."""
    q, z = density_of(sensor, box, z)
    if z is None:
        x, volume, _ = cells(box, (1, 1, 1), 100)
        pi = np.exp(sensor.log_likelihood(x, None)).sum() * volume
        assert np.exp(q.log_density(x)).sum() * volume == pytest.approx(1.0)
        assert q.log_pi == pytest.approx(np.log(pi), abs=2e-3)
        return
    start = max(box.low[0], 0.0)
    d = start + (box.high[0] - start) * (np.arange(80) + 0.5) / 80
    wide = np.linspace(-8.0, 8.0, 801)[:-1] + 0.01
    grid = np.stack(np.meshgrid(d, wide[::4] + 0.03, wide[::4] + 0.03, indexing="ij"))
    grid = grid.reshape(3, -1)
    x = grid[0] * np.stack(
        [np.ones(grid.shape[1]), *(z[k] + sensor.sigma * grid[k + 1] for k in range(2))]
    )
    volume = grid[0] ** 2 * (0.08 * sensor.sigma) ** 2 * (box.high[0] - start) / 80
    log_q = q.log_density(x)
    p = np.exp(sensor.log_likelihood(x, z) + box.log_prior(x))
    # Midpoints see a box's edge at half a step, 0.04 of a deviation: up to 0.02 of the mass.
    assert np.exp(log_q) @ volume == pytest.approx(1.0, abs=0.01)
    assert q.log_pi == pytest.approx(np.log(p @ volume), abs=0.01)
    there = p > 0.0
    assert (np.isfinite(log_q) == there).all()
    off = log_q[there] - np.log(p[there]) + q.log_pi
    mass = np.exp(log_q[there]) * volume[there]
    assert np.abs(off) @ mass < 2e-3


@every_look
def test_samples_have_this_density(sensor, box, z):
    """Each axis in steps of its cumulative density for a reading; χ² over 6 × 5 × 4 cells."""
    q, z = density_of(sensor, box, z)
    x = q.sample(Draws(5, 1), 0, N)
    assert np.isfinite(q.log_density(x)).all()
    assert (box.log_prior(x) == 0.0).all()
    if z is None:
        for k in range(3):
            side = box.high[k] - box.low[k]
            assert kstest((x[k] - box.low[k]) / side, "uniform").pvalue > 1e-4
        return
    shape = (6, 5, 4)
    # Uniform places in depth and image, weighed by density and Jacobian: what a cell should hold.
    rng = np.random.default_rng(3)
    start, count = max(box.low[0], 0.0), 2_000_000
    d = rng.uniform(start, box.high[0], count)
    e = rng.standard_normal((2, count))
    u = z[:, None] + sensor.sigma * e
    y = np.stack([d, d * u[0], d * u[1]])
    normal = np.exp(-0.5 * (e**2).sum(axis=0)) / (2.0 * np.pi * sensor.sigma**2)
    w = np.exp(q.log_density(y)) * d**2 * (box.high[0] - start) / normal / count
    edges = [np.quantile(x[0], np.linspace(0.0, 1.0, 7))[1:-1]]
    edges += [np.quantile(x[k] / x[0], np.linspace(0.0, 1.0, shape[k] + 1))[1:-1] for k in (1, 2)]

    def cell(x):
        seen = (x[0], x[1] / x[0], x[2] / x[0])
        at = [np.searchsorted(edge, s) for edge, s in zip(edges, seen, strict=True)]
        return np.ravel_multi_index(at, shape)

    expected = N * np.bincount(cell(y), w, np.prod(shape))
    observed = np.bincount(cell(x), minlength=np.prod(shape))
    often = expected > 10.0
    share = observed[often].sum() / expected[often].sum()
    assert share == pytest.approx(1.0, abs=0.02)
    assert chisquare(observed[often], share * expected[often]).pvalue > 1e-4


@pytest.mark.parametrize("name", ["middle", "cut by the box"])
def test_means_are_those_of_brute_force_importance_sampling(name):
    """Uniform places weighed by p(z | x): means within 4.5 standard errors of both."""
    sensor, box, z = LOOKS[name]
    q, z = density_of(sensor, box, z)
    x = q.sample(Draws(8), 0, N)
    y = box.sample(Draws(9), 0, 400_000)
    w = np.exp(sensor.log_likelihood(y, z))
    pi = w.mean() * box.volume
    assert q.log_pi == pytest.approx(np.log(pi), abs=4.5 * w.std() / w.mean() / np.sqrt(len(w)))
    w /= w.sum()
    for of_x, of_y in ((x, y), (x**2, y**2)):
        mean = of_y @ w
        error = np.sqrt((of_y - mean[:, None]) ** 2 @ w**2 + of_x.var(axis=1) / N)
        assert (np.abs(of_x.mean(axis=1) - mean) < 4.5 * error).all()


def test_an_unclipped_ray_has_depths_as_their_cube():
    """∝ ρ² dρ: all rays that are likely end at the far side of the box."""
    q, _ = density_of(SHARP, AHEAD, (0.0, 0.0))
    d = q.sample(Draws(4), 0, N)[0]
    assert kstest((d**3 - 1.0) / (6.0**3 - 1.0), "uniform").pvalue > 1e-4
    cubes = (6.0**3 - 1.0) / 3.0
    assert q.log_pi == pytest.approx(np.log(SHARP.p_detect * cubes), abs=1e-5)


@every_look
def test_chunks_do_not_matter(sensor, box, z):
    q, _ = density_of(sensor, box, z)
    whole = q.sample(Draws(3, 2, 1), 40, 200)
    parts = [q.sample(Draws(3, 2, 1), 40 + a, b - a) for a, b in ((0, 1), (1, 77), (77, 200))]
    assert np.array_equal(whole, np.concatenate(parts, axis=1))


@pytest.mark.parametrize("noise", [1e-4, 0.01, 0.5])
@pytest.mark.parametrize("z", [(0.68, 0.5), (-0.68, -0.5), (0.68, -0.5), (-0.6, 0.0), (9.0, 0.0)])
def test_no_look_is_too_odd(noise, z):
    """Also where the box is many deviations beside the ray, or z outside the image."""
    q, _ = density_of(ImageBearing(noise=noise), Box((3.0, -0.5, -0.2), (6.0, 0.5, 0.2)), z)
    x = q.sample(Draws(1), 0, 500)
    log_q = q.log_density(np.concatenate([x, -x, 1e3 * x], axis=1))
    assert np.isfinite(log_q[:500]).all()
    assert (log_q[500:] == -np.inf).all()
    assert not np.isnan(q.log_pi)


def test_a_box_behind_the_camera_is_refused():
    with pytest.raises(ConfigError, match="ahead"):
        CameraRay(SHARP, Box((-3.0, -1.0, -1.0), (0.0, 1.0, 1.0)))


@pytest.mark.parametrize("high", [(1.0, 0.0, 1.0), (1.0, np.nan, 1.0), (np.inf, 1.0, 1.0)])
def test_a_box_has_sides(high):
    with pytest.raises(ConfigError, match="sides"):
        Box((0.0, 0.0, 0.0), high)


def test_a_box_is_uniform_inside_and_nothing_outside():
    x = BOX.sample(Draws(2), 0, 1000)
    assert (BOX.log_prior(x) == 0.0).all()
    assert BOX.log_density(x) == pytest.approx(-np.log(7.0 * 5.0 * 3.0))
    assert (BOX.log_density(x + 10.0) == -np.inf).all()
    assert np.array_equal(x[:, 7:], BOX.sample(Draws(2), 7, 993))
