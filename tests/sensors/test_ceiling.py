"""Ceiling cameras: densities that integrate to 1, and images of a mosaic against plain NumPy."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.ndimage import gaussian_filter

from mcloc.errors import ConfigError
from mcloc.events import Image
from mcloc.geometry import compose
from mcloc.maps.mosaic import Mosaic
from mcloc.sensors import CAMERAS
from mcloc.sensors.ceiling import NOTHING, CeilingBrightness
from mcloc.sensors.ceiling_patch import CeilingPatch

POSE = np.array([2.0, 1.5, 0.8])
both = pytest.mark.parametrize("name", list(CAMERAS))


def mosaic(seed=0, origin=(0.0, 0.0, 0.0)):
    """6 m × 5 m of soft spots."""
    image = gaussian_filter(np.random.default_rng(seed).random((100, 120)), 5)
    image = 0.2 + 0.6 * (image - image.min()) / np.ptp(image)
    return Mosaic(image, 0.05, np.array(origin))


def image_at(m, pose, pixels=15, pixel=0.1, t=0.0, **changes):
    """What a camera sees: brightness at the middle of each pixel."""
    off = pixel * (np.arange(pixels) - 0.5 * (pixels - 1))
    ahead, left = np.meshgrid(-off, -off, indexing="ij")
    local = np.column_stack([ahead.ravel(), left.ravel(), np.zeros(pixels**2)])
    at = np.ascontiguousarray(compose(pose, local).T)
    return Image(t, m.at(at).reshape(pixels, pixels), **changes)


@pytest.mark.parametrize("e", [0.0, 0.06, 0.3, 0.9, 1.0, np.nan])
@pytest.mark.parametrize("dark", [0.0, 0.05, 0.3])
def test_brightness_and_blackouts_have_the_probability_1(e, dark):
    model = CeilingBrightness(mosaic(), dark=dark)
    inside = [e] if dark < e < 1.0 else None
    total, _ = quad(lambda b: float(model.density(b, np.array(e))), dark, 1.0, points=inside)
    assert total + model.p_blackout == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("contrast", [0.0, 0.05, 0.2, 1.0])
def test_a_patch_has_the_probability_1_over_the_sphere(contrast):
    """Of 4 points, whose directions are those of space: ρ is uniform over −1 … 1 there."""
    model = CeilingPatch(mosaic(), across=2)
    kappa = np.array(model.concentration(contrast**2))
    mean, _ = quad(lambda rho: 0.5 * float(np.exp(model.log_ratio(kappa, np.array(rho)))), -1, 1)
    assert mean == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("across", [3, 5, 11])
def test_a_patch_has_the_probability_1_in_more_dimensions(across):
    """The density of ρ of uniform directions in D dimensions is ∝ (1 − ρ²)^((D − 3)/2)."""
    model = CeilingPatch(mosaic(), across=across)
    power = 0.5 * (model.count - 1 - 3)
    for kappa in (0.0, 3.0, 40.0):

        def weighted(rho, kappa=kappa):
            p = float(np.exp(model.log_ratio(np.array(kappa), np.array(rho))))
            return p * (1.0 - rho * rho) ** power

        total, _ = quad(weighted, -1, 1, limit=200)
        of_all, _ = quad(lambda rho: (1.0 - rho * rho) ** power, -1, 1, limit=200)
        assert total / of_all == pytest.approx(1.0, abs=2e-3)  # log C is a straight line by parts


def test_noise_turns_a_patch_as_far_as_the_model_says():
    """Mean correlation of noisy patches with the true one, against that of the density."""
    model = CeilingPatch(mosaic(), mismatch=0.0101)
    rng = np.random.default_rng(0)
    d = rng.standard_normal(model.count)
    d = 0.5 * (d - d.mean()) / np.linalg.norm(d - d.mean())
    seen = d + model.sigma_noise * rng.standard_normal((20_000, model.count))
    seen -= seen.mean(axis=1, keepdims=True)
    found = np.mean(seen @ d / np.linalg.norm(seen, axis=1)) / np.linalg.norm(d)
    kappa = float(model.concentration(0.25))
    power = 0.5 * (model.count - 1 - 3)
    rho = np.linspace(-1, 1, 20_001)[1:-1]
    weight = np.exp(kappa * (rho - 1.0)) * (1.0 - rho * rho) ** power
    expected = np.sum(weight * rho) / np.sum(weight)
    # The two agree to first order in a = (D − 1)/κ: 1/√(1 + a) = 1 − a/2 + 3/8 a² − …
    assert found == pytest.approx(expected, abs=0.375 * ((model.count - 2) / kappa) ** 2)


@both
def test_the_place_of_an_image_fits_best(name):
    m = mosaic()
    model = CAMERAS.make(name, m)
    z = image_at(m, POSE)
    rng = np.random.default_rng(1)
    x = rng.uniform((1, 1, -3), (5, 4, 3), (2000, 3)).T.copy()
    here = model.log_likelihood(POSE[:, None].copy(), z)[0]
    elsewhere = model.log_likelihood(x, z)
    assert here > np.quantile(elsewhere, 0.9)
    assert here == pytest.approx(0.0, abs=0.15)
    assert model.explained(POSE[:, None].copy(), z) == pytest.approx(1.0)
    if name == "ceiling-patch":
        assert model.explained(x, z).mean() < 0.5
    else:
        e = m.averaged(model.radius).at(x)
        near = np.abs(model.middle(z) - e) <= 3.0 * model.sigma(e)
        assert np.array_equal(model.explained(x, z), near)


def test_a_correlation_is_that_of_numpy():
    m = mosaic()
    model = CeilingPatch(m)
    z = image_at(m, POSE)
    x = np.random.default_rng(2).uniform((1, 1, -3), (5, 4, 3), (50, 3)).T.copy()
    v, _ = model.pattern(z)
    _, rho = model._compared(x, v)
    smooth = m.averaged(model.radius)
    told = model.told(z, model.points)
    for k, pose in enumerate(x.T):
        local = np.column_stack([model.points.T, np.zeros(model.count)])
        seen = smooth.at(np.ascontiguousarray(compose(pose, local).T))
        assert rho[k] == pytest.approx(np.corrcoef(told, seen)[0, 1], abs=1e-4)


@pytest.mark.parametrize(("gain", "offset"), [(0.7, 0.1), (1.2, -0.1), (1.0, 0.15)])
def test_a_patch_does_not_change_with_gain_and_offset(gain, offset):
    m = mosaic()
    model = CeilingPatch(m)
    z = image_at(m, POSE)
    changed = Image(0.0, gain * z.pixels + offset)
    assert model.pattern(changed)[0] == pytest.approx(model.pattern(z)[0], abs=1e-9)
    x = np.random.default_rng(3).uniform((1, 1, -3), (5, 4, 3), (500, 3)).T.copy()
    off = model.log_likelihood(x, changed) - model.log_likelihood(x, z)
    assert np.ptp(off) < 1e-9  # only what the best would be is another


@both
@pytest.mark.parametrize("kind", ["black", "nan"])
def test_a_covered_lens_says_nothing(name, kind):
    model = CAMERAS.make(name, mosaic())
    z = Image(0.0, np.full((15, 15), 0.01 if kind == "black" else np.nan))
    x = np.random.default_rng(4).uniform((1, 1, -3), (5, 4, 3), (20, 3)).T.copy()
    assert model.covered(z)
    assert (model.log_likelihood(x, z) == 0.0).all()
    assert model.readings(z) == NOTHING
    assert np.isnan(model.explained(x, z)).all()


def test_a_flat_patch_says_nothing_and_a_flat_brightness_does():
    flat = Image(0.0, np.full((15, 15), 0.6))
    assert CeilingPatch(mosaic()).covered(flat)
    assert not CeilingBrightness(mosaic()).covered(flat)


@both
def test_an_image_counts_as_far_as_it_is_news(name):
    m = mosaic()
    model = CAMERAS.make(name, m)
    x = np.random.default_rng(5).uniform((1, 1, -3), (5, 4, 3), (50, 3)).T.copy()
    whole, part = (model.log_likelihood(x, image_at(m, POSE, novelty=n)) for n in (1.0, 0.3))
    assert part == pytest.approx(0.3 * whole)
    readings = [model.readings(image_at(m, POSE, novelty=n)) for n in (1.0, 0.3)]
    assert readings[1] == pytest.approx(0.3 * readings[0])


@both
def test_unknown_ceiling_is_like_any_ceiling(name):
    """Off the mosaic p is that of an image of anything: below a good fit, above a bad one."""
    m = mosaic()
    model = CAMERAS.make(name, m)
    z = image_at(m, POSE)
    far = model.log_likelihood(np.array([[100.0], [100.0], [0.0]]), z)[0]
    x = np.random.default_rng(6).uniform((1, 1, -3), (5, 4, 3), (2000, 3)).T.copy()
    assert model.log_likelihood(x, z).min() < far < model.log_likelihood(POSE[:, None], z)[0]
    assert np.isfinite(far)


@both
@pytest.mark.parametrize("turn", [0.5, -2.0])
def test_cameras_may_be_turned_and_look_from_below(name, turn):
    m = mosaic()
    x = np.random.default_rng(7).uniform((1, 1, -3), (5, 4, 3), (100, 3)).T.copy()
    straight = CAMERAS.make(name, m).log_likelihood(x, image_at(m, POSE, 41, 0.05))
    turned = image_at(m, POSE + np.array([0.0, 0.0, turn]), 41, 0.05)
    model = CAMERAS.make(name, m, turn=turn, pixel=0.05)
    reference = CAMERAS.make(name, m, pixel=0.05).log_likelihood(x, image_at(m, POSE, 41, 0.05))
    assert model.log_likelihood(x, turned) == pytest.approx(reference, abs=0.05)
    below = Image(0.0, np.ascontiguousarray(turned.pixels[:, ::-1]))
    model = CAMERAS.make(name, m, turn=turn, pixel=0.05, view="below")
    assert model.log_likelihood(x, below) == pytest.approx(reference, abs=0.05)
    assert straight.shape == (100,)


@both
def test_the_frame_of_the_mosaic_does_not_matter(name):
    frame = np.array([30.0, -12.0, 2.3])
    here = mosaic()
    there = Mosaic(here.image, here.resolution, compose(frame, here.origin))
    z = image_at(here, POSE)
    x = np.random.default_rng(8).uniform((-1, -1, -3), (7, 6, 3), (300, 3)).T.copy()
    moved = np.ascontiguousarray(compose(frame, x.T).T)
    a, b = (CAMERAS.make(name, m).log_likelihood(p, z) for m, p in ((here, x), (there, moved)))
    assert a == pytest.approx(b, abs=1e-6)


@both
def test_an_image_that_is_too_small_is_refused_with_the_remedy(name):
    model = CAMERAS.make(name, mosaic(), pixel=0.01)
    with pytest.raises(ConfigError, match="set it to what a pixel covers"):
        model.log_likelihood(POSE[:, None], Image(0.0, np.full((15, 15), 0.5)))


def test_drift_makes_bright_places_less_certain():
    model = CeilingBrightness(mosaic())
    expected = math.sqrt(0.08**2 + 0.03**2 + (0.1 * 0.8) ** 2)
    assert model.sigma(np.array([0.8])) == pytest.approx(expected)
