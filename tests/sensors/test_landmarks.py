"""Range and bearing to known landmarks: densities by quadrature, simulated sightings against them,
and posteriors over poses against a grid that knows nothing of the model's code.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import chisquare, norm

from mcloc.errors import ConfigError, MapError
from mcloc.events import UNKNOWN, Sightings
from mcloc.geometry import compose
from mcloc.maps.landmarks import Landmarks
from mcloc.registry import parameters
from mcloc.sensors.landmarks import LandmarkModel

PLACES = np.array([[2.7, 0.0], [-2.7, 0.0], [1.35, 1.9], [-1.35, -1.9]])
SHARP = LandmarkModel(Landmarks.numbered(PLACES))
POOR = LandmarkModel(
    Landmarks.numbered(PLACES),
    sigma_range=0.3,
    sigma_relative=0.2,
    sigma_bearing=1.5,
    range_max=5.0,
    p_outlier=0.1,
)
every_sensor = pytest.mark.parametrize("sensor", [SHARP, POOR], ids=["sharp", "poor"])
distances = pytest.mark.parametrize("d", [0.0, 0.04, 1.0, 4.9, 7.95, 30.0])
POSE = np.array([[0.5], [-0.4], [2.8]])
NAN = math.nan


def log_p(sensor, pose, z):
    """log p(z | x) per metre and radian, number by number, by SciPy's normal."""
    eps, total = sensor.p_outlier, 0.0
    for landmark, r, b in zip(z.landmark, z.range, z.bearing, strict=True):
        dx, dy = sensor.places[landmark] - pose[:2]
        d = math.sqrt(dx * dx + dy * dy)
        sigma = math.sqrt(sensor.sigma_range**2 + (sensor.sigma_relative * d) ** 2)
        if not math.isnan(r):
            total += math.log((1 - eps) * norm.pdf(r, d, sigma) + eps / sensor.range_max)
        if not math.isnan(b):
            off = b - (math.atan2(dy, dx) - pose[2])
            turns = off + 2.0 * math.pi * np.arange(-9, 10)
            near = norm.pdf(turns, 0.0, sensor.sigma_bearing).sum()
            total += math.log((1 - eps) * near + eps / (2.0 * math.pi))
    return total


def seen(landmarks, ranges, bearings):
    """At no time in particular."""
    return Sightings(0.0, landmarks, ranges, bearings)


def expected(pose, landmarks):
    """What an errorless sensor sees."""
    dx, dy = (PLACES[landmarks] - pose[:2, 0]).T
    return seen(landmarks, np.hypot(dx, dy), np.arctan2(dy, dx) - pose[2, 0])


@every_sensor
@distances
def test_ranges_have_a_density_but_for_those_that_are_none(sensor, d):
    """∫ p dr over (0, range_max], and the chance of the rest."""
    eps, top = sensor.p_outlier, sensor.range_max
    sigma = math.hypot(sensor.sigma_range, sensor.sigma_relative * d)
    cuts = np.unique(np.clip([0.0, d - 8.0 * sigma, d, d + 8.0 * sigma, top], 0.0, top))
    within = sum(
        quad(lambda r: sensor.range_density(r, np.array(d)).item(), a, b)[0]
        for a, b in pairwise(cuts)
    )
    none = (1 - eps) * (norm.cdf(0.0, d, sigma) + norm.sf(top, d, sigma))
    assert within + none == pytest.approx(1.0, abs=1e-6)


@every_sensor
def test_bearings_have_a_density_over_the_circle(sensor):
    """By the midpoint rule, which is exact for what is periodic and smooth."""
    n = 2000
    off = (np.arange(n) + 0.5) * 2.0 * np.pi / n - np.pi
    for shift in (0.0, 2.0, -9.0):
        p = sensor.bearing_density(off + shift)
        assert p.sum() * 2.0 * np.pi / n == pytest.approx(1.0, abs=1e-9)


@every_sensor
def test_likelihoods_are_those_of_the_equation(sensor):
    rng = np.random.default_rng(3)
    x = rng.uniform([[-2.7], [-1.8], [-3.1]], [[2.7], [1.8], [3.1]], (3, 60))
    z = seen([3, 0, 2, 2], [1.1, NAN, 2.5, 4.0], [0.3, -2.0, NAN, 3.0])
    found = sensor.log_likelihood(x, z)
    wanted = np.array([log_p(sensor, pose, z) for pose in x.T])
    assert found - found[0] == pytest.approx(wanted - wanted[0])
    # Relative to a sighting that is just as expected, term by term.
    best = [
        log_p(sensor, np.array([*(PLACES[3] - (1.1, 0.0)), -0.3]), seen([3], [1.1], [0.3])),
        log_p(sensor, np.array([*(PLACES[0] - (1.0, 0.0)), 2.0]), seen([0], [NAN], [-2.0])),
        log_p(sensor, np.array([*(PLACES[2] - (2.5, 0.0)), 0.0]), seen([2], [2.5], [NAN])),
        log_p(sensor, np.array([*(PLACES[2] - (4.0, 0.0)), -3.0]), seen([2], [4.0], [3.0])),
    ]
    assert found == pytest.approx(wanted - sum(best))


@every_sensor
def test_what_is_just_as_expected_is_0_and_nothing_much_more(sensor):
    z = expected(POSE, [0, 1, 2, 3])
    assert sensor.log_likelihood(POSE, z) == pytest.approx(0.0, abs=1e-12)
    x = PLACES[0][:, None] - np.outer([1.0, 0.0], np.linspace(3.0, 4.1, 500))
    most = sensor.log_likelihood(x, seen([0], [4.0], [NAN])).max()
    assert 0.0 < most <= 0.5 * sensor.sigma_relative**2


@every_sensor
def test_simulated_sightings_have_this_distribution(sensor):
    """χ² of ranges and bearings that are drawn as the equation says."""
    n, rng = 20_000, np.random.default_rng(5)
    d, beta = np.hypot(2.2, 0.4), np.arctan2(0.4, 2.2) - POSE[2, 0]
    sigma = np.hypot(sensor.sigma_range, sensor.sigma_relative * d)
    wild = rng.random((2, n)) < sensor.p_outlier
    r = np.where(wild[0], rng.uniform(0.0, sensor.range_max, n), rng.normal(d, sigma, n))
    b = np.where(wild[1], rng.uniform(-3.0, 3.5, n), rng.normal(beta, sensor.sigma_bearing, n))
    b[wild[1]] = rng.uniform(-np.pi, np.pi, wild[1].sum())
    b = np.angle(np.exp(1j * b))

    def p_of_range(v):
        return sensor.range_density(v, np.array(d))

    def p_of_bearing(v):
        return sensor.bearing_density(v - beta)

    cases = ((r, p_of_range, 0.0, sensor.range_max), (b, p_of_bearing, -np.pi, np.pi))
    for values, density, low, high in cases:
        blocks, nodes = 40, 200
        at = low + (np.arange(blocks * nodes) + 0.5) * (high - low) / (blocks * nodes)
        mass = n * density(at).reshape(blocks, nodes).mean(axis=1) * (high - low) / blocks
        counts = np.histogram(values, blocks, (low, high))[0]
        observed = np.append(counts, n - counts.sum())
        wanted = np.append(mass, n - mass.sum())
        often = wanted >= 5.0
        pooled = [np.append(v[often], v[~often].sum()) for v in (observed, wanted)]
        kept = pooled[1] > 1e-6
        assert chisquare(pooled[0][kept], pooled[1][kept]).pvalue > 1e-4


def test_the_posterior_is_that_of_a_grid():
    """Poses spread evenly and weighed, against the equation on a lattice: mean place and mean
    heading, within 4.5 standard errors.
    """
    rng = np.random.default_rng(6)
    sensor = LandmarkModel(
        Landmarks.numbered(PLACES), sigma_range=0.2, sigma_relative=0.1, sigma_bearing=0.3
    )
    z = seen([0, 3], [2.4, NAN], [-2.6, 0.7])
    half = np.array([2.7, 1.8, np.pi])
    axes = [
        h * (2.0 * (np.arange(k) + 0.5) / k - 1.0) for h, k in zip(half, (54, 36, 60), strict=True)
    ]
    grid = np.stack([v.ravel() for v in np.meshgrid(*axes, indexing="ij")])
    eps = sensor.p_outlier
    p = np.ones(grid.shape[1])
    for landmark, r, b in zip(z.landmark, z.range, z.bearing, strict=True):
        to = (PLACES[landmark, 0] - grid[0]) + 1j * (PLACES[landmark, 1] - grid[1])
        if not math.isnan(r):
            sigma = np.sqrt(0.2**2 + 0.1**2 * np.abs(to) ** 2)
            p *= (1 - eps) * norm.pdf(r, np.abs(to), sigma) + eps / sensor.range_max
        off = np.angle(np.exp(1j * b) / (to / np.abs(to) * np.exp(-1j * grid[2])))
        near = sum(norm.pdf(off + turn, 0.0, 0.3) for turn in (-2 * np.pi, 0.0, 2 * np.pi))
        p *= (1 - eps) * near + eps / (2.0 * np.pi)
    p /= p.sum()

    def of(x):
        return np.stack([x[0], x[1], np.cos(x[2]), np.sin(x[2]), x[0] ** 2, x[1] ** 2])

    x = half[:, None] * rng.uniform(-1.0, 1.0, (3, 200_000))
    w = np.exp(sensor.log_likelihood(x, z))
    w /= w.sum()
    wanted, found = of(grid) @ p, of(x) @ w
    error = np.sqrt(((of(x) - wanted[:, None]) ** 2) @ w**2)
    assert error.max() < 0.05  # or the comparison says nothing
    assert (np.abs(found - wanted) < 4.5 * error + 0.002).all()


def test_places_are_weighed_by_ranges_alone():
    x = np.random.default_rng(7).uniform(-2.0, 2.0, (3, 100))
    ranges = seen([0, 1, 2], [1.0, 3.0, 2.0], [NAN] * 3)
    both = seen([0, 1, 2], [1.0, 3.0, 2.0], [0.1, NAN, NAN])
    assert np.array_equal(SHARP.log_likelihood(x[:2], ranges), SHARP.log_likelihood(x, ranges))
    assert np.array_equal(SHARP.explained(x[:2], ranges), SHARP.explained(x, ranges))
    for ask in (SHARP.log_likelihood, SHARP.explained):
        with pytest.raises(ConfigError, match="heading"):
            ask(x[:2], both)


@pytest.mark.parametrize("none", [NAN, 0.0, -1.0, np.inf, -np.inf, 8.01])
def test_a_range_that_is_none_says_nothing(none):
    x = np.random.default_rng(8).uniform(-2.0, 2.0, (3, 100))
    z, without = (
        seen([0, 2], [none, 2.0], [0.1, 0.2]),
        seen([2, 0], [2.0, NAN], [0.2, 0.1]),
    )
    assert SHARP.log_likelihood(x, z) == pytest.approx(SHARP.log_likelihood(x, without), abs=1e-12)
    assert SHARP.explained(x, z) == pytest.approx(SHARP.explained(x, without))
    assert SHARP.readings(z) == SHARP.beams(z) == 3


def test_a_sighting_without_a_name_is_explained_by_any_landmark():
    z = expected(POSE, [0, 2])
    nameless = replace(z, landmark=np.full(2, UNKNOWN))
    assert SHARP.explained(POSE, nameless) == pytest.approx(1.0)
    assert SHARP.explained(POSE + np.array([[0.0], [0.0], [0.9]]), nameless) < 1.0
    swapped = replace(z, landmark=z.landmark[::-1])
    assert SHARP.explained(POSE, swapped) == pytest.approx(0.5)  # the ranges are alike


def test_an_empty_sighting_says_nothing():
    x = np.zeros((3, 5))
    for z in (seen([], [], []), seen([1], [NAN], [NAN])):
        assert (SHARP.log_likelihood(x, z) == 0.0).all()
        assert np.isnan(SHARP.explained(x, z)).all()
        assert SHARP.beams(z) == 0
        assert 0.0 < SHARP.readings(z) < 1e-6
        assert SHARP.source(z) == "landmarks"
    assert SHARP.source(Sightings(0.0, [], [], [], source="camera")) == "camera"


def test_what_is_explained():
    z = expected(POSE, [0, 2])
    sigma = np.hypot(0.05, 0.1 * z.range)
    off = 0.02 * np.array([2.9, -3.1]) + [0.0, 2.0 * np.pi]
    z = seen([0, 2], z.range + sigma * [2.9, 3.1], z.bearing + off)
    assert SHARP.explained(POSE, z) == pytest.approx(0.5)
    turned = POSE + np.array([[0.0], [0.0], [0.5]])
    assert SHARP.explained(turned, z) == pytest.approx(0.25)


@every_sensor
def test_no_pose_and_no_sighting_is_impossible(sensor):
    """p > 0 everywhere, also on a landmark, far away and after many turns."""
    x = np.array([[2.7, 1e7, 0.0], [0.0, -1e7, 0.0], [0.0, 3.0, np.pi]])
    z = seen([0, 0, 3], [1e-9, 5.0, 3.0], [3.1, -500.0, 0.0])
    log_p = sensor.log_likelihood(x, z)
    assert np.isfinite(log_p).all()
    least = math.log(sensor.p_outlier / sensor.range_max) + math.log(sensor.p_outlier / (2 * np.pi))
    assert (log_p > 3 * (least - 10.0)).all()


@every_sensor
def test_chunks_do_not_matter(sensor):
    rng = np.random.default_rng(9)
    x = rng.uniform(-2.0, 2.0, (3, 200))
    z = Sightings(
        0.0, rng.integers(0, 4, 12), rng.uniform(0.1, 4.0, 12), rng.uniform(-3.0, 3.0, 12)
    )
    for ask in (sensor.log_likelihood, sensor.explained):
        whole = ask(x, z)
        assert whole.shape == (200,)
        parts = [ask(x[:, a:b], z) for a, b in ((0, 1), (1, 78), (78, 200))]
        assert np.array_equal(whole, np.concatenate(parts))


@every_sensor
def test_the_frame_of_the_map_does_not_matter(sensor):
    frame = np.array([12.0, -7.0, 2.2])
    x = np.random.default_rng(10).uniform(-2.0, 2.0, (3, 100))
    places = compose(frame, np.column_stack([PLACES, np.zeros(4)]))[:, :2]
    settings = {f.name: getattr(sensor, f.name) for f in parameters(sensor)}
    moved = LandmarkModel(Landmarks.numbered(places), **settings)
    z = seen([3, 0, 2, 2], [1.1, NAN, 2.5, 4.0], [0.3, -2.0, NAN, 3.0])
    there = np.ascontiguousarray(compose(frame, x.T).T)
    assert moved.log_likelihood(there, z) == pytest.approx(sensor.log_likelihood(x, z))


WRONG = {
    "sigma_range": 0.0,
    "sigma_relative": -0.1,
    "sigma_bearing": 2.1,
    "range_max": np.inf,
    "p_outlier": 0.0,
}


@pytest.mark.parametrize(("name", "value"), WRONG.items())
def test_a_parameter_that_cannot_be_is_refused(name, value):
    with pytest.raises(ConfigError, match=name):
        LandmarkModel(Landmarks.numbered(PLACES), **{name: value})


@pytest.mark.parametrize("places", [PLACES[:, :1], [1.0, 2.0], [[0.0, NAN]]])
def test_a_map_that_cannot_be_is_refused(places):
    with pytest.raises(MapError, match="finite x, y"):
        Landmarks.numbered(places)


@pytest.mark.parametrize("landmark", [4, 9])
def test_a_landmark_that_is_not_in_the_map_is_refused(landmark):
    z = seen([0, landmark], [1.0, 1.0], [0.0, 0.0])
    for ask in (SHARP.log_likelihood, SHARP.explained):
        with pytest.raises(ConfigError, match=f"landmark {landmark}"):
            ask(POSE, z)


@pytest.mark.parametrize("wrong", [([0], [1.0, 2.0], [0.0]), (0, 1.0, 0.0), ([0.5], [1.0], [0.0])])
def test_sightings_that_cannot_be_are_refused(wrong):
    with pytest.raises(ConfigError):
        seen(*wrong)


# Sensors beside the robot's middle


MOUNT = np.array([0.3, -0.2, 0.7])
SOME = ([3, 0, 2, 2], [1.1, NAN, 2.5, 4.0], [0.3, -2.0, NAN, 3.0])


def test_what_is_seen_is_seen_from_the_sensor():
    x = np.random.default_rng(11).uniform(-2.0, 2.0, (3, 100))
    sensor = np.ascontiguousarray(compose(x.T, MOUNT).T)
    mounted = Sightings(0.0, *SOME, mount=MOUNT)
    for ask in (DARK.log_likelihood, SHARP.log_likelihood, SHARP.explained):
        assert ask(x, mounted) == pytest.approx(ask(sensor, seen(*SOME)))
    assert not np.allclose(SHARP.log_likelihood(x, mounted), SHARP.log_likelihood(x, seen(*SOME)))
    with pytest.raises(ConfigError, match="mount"):
        SHARP.log_likelihood(x[:2], Sightings(0.0, [0], [1.0], [NAN], mount=MOUNT))


# Landmarks whose names are not known, sightings of nothing, and landmarks that were missed


DARK = LandmarkModel(  # sees little
    Landmarks.numbered(PLACES), range_max=3.0, p_outlier=0.05, p_false=0.2, p_detect=0.7, fov=1.2
)


def view(sensor, pose):
    """(L,) v_j of each landmark, by SciPy's normal."""
    dx, dy = (sensor.places - pose[:2]).T
    d, beta = np.hypot(dx, dy), np.arctan2(dy, dx) - pose[2]
    beta = np.angle(np.exp(1j * beta))
    within = norm.cdf(sensor.range_max, d, np.hypot(sensor.sigma_range, sensor.sigma_relative * d))
    half = 0.5 * sensor.fov
    return within * (
        norm.cdf(half, beta, sensor.sigma_bearing) - norm.cdf(-half, beta, sensor.sigma_bearing)
    )


def p_of(sensor, pose, landmark, r, b):
    """p(r, b | x) per metre and radian."""
    false = sensor.p_false / (sensor.range_max * 2.0 * math.pi)
    if landmark != UNKNOWN:
        of_it = math.exp(log_p(sensor, pose, seen([landmark], [r], [b])))
        return (1.0 - sensor.p_false) * of_it + false
    v = view(sensor, pose)
    each = [math.exp(log_p(sensor, pose, seen([k], [r], [b]))) for k in range(len(v))]
    share = (1.0 - sensor.p_false) * min(v.sum(), 1.0)
    mean = v @ each / v.sum() if v.sum() > 0.0 else 0.0
    return share * mean + (1.0 - share) / (sensor.range_max * 2.0 * math.pi)


def poses(n, seed):
    low, high = [[-2.7], [-1.8], [-3.1]], [[2.7], [1.8], [3.1]]
    return np.random.default_rng(seed).uniform(low, high, (3, n))


def test_likelihoods_of_sightings_that_may_be_of_any_landmark_or_none():
    """Against the equation, for pairs of poses: what it is relative to does not depend on them."""
    x = poses(60, 12)
    for landmark in (UNKNOWN, 2):
        z = seen([landmark, landmark], [1.4, 2.2], [0.3, -0.2])
        bare = replace(DARK, p_detect=0.0)
        found = bare.log_likelihood(x, z)
        wanted = np.array(
            [
                math.log(p_of(bare, pose, landmark, 1.4, 0.3))
                + math.log(p_of(bare, pose, landmark, 2.2, -0.2))
                for pose in x.T
            ]
        )
        assert found - found[0] == pytest.approx(wanted - wanted[0], abs=1e-9)


def test_misses_count_by_the_chance_that_they_had():
    x, z = poses(60, 13), seen([2, 0], [1.4, 2.2], [0.3, -0.2])
    off = np.array(
        [
            sum(
                math.log(D if k in (0, 2) else 1.0 - D)
                for k, D in enumerate(0.7 * (0.05 + 0.95 * view(DARK, pose)))
            )
            for pose in x.T
        ]
    )
    found = DARK.log_likelihood(x, z) - replace(DARK, p_detect=0.0).log_likelihood(x, z)
    assert found == pytest.approx(off - 2.0 * math.log(0.7))
    bare, anonymous = replace(DARK, p_detect=0.0), seen([2, UNKNOWN], [1.4, 2.2], [0.3, -0.2])
    assert np.array_equal(DARK.log_likelihood(x, anonymous), bare.log_likelihood(x, anonymous))


@pytest.mark.parametrize("mount", [(0.0, 0.0, 0.0), (0.1, 0.0, 2.9)], ids=["ahead", "turned"])
@pytest.mark.parametrize(("fov", "sigma"), [(1.2, 0.3), (6.2, 0.02), (6.2, 0.3), (4.0, 1.9)])
def test_a_view_whose_edge_is_near_the_back_ends_there_from_both_sides(fov, sigma, mount):
    """A bearing that is measured beyond ±π comes in from the other side: against many turns of
    SciPy's normal, for cameras that look anywhere.
    """
    sensor = replace(DARK, fov=fov, sigma_bearing=sigma, range_max=50.0)
    x = np.stack([np.full(200, 0.3), np.full(200, -0.1), np.linspace(-np.pi, np.pi, 200)])
    missed = sensor.log_likelihood(x, Sightings(0.0, [], [], [], mount=np.array(mount)))
    wanted = np.zeros(200)
    for k, pose in enumerate(compose(x.T, np.array(mount))):
        dx, dy = (PLACES - pose[:2]).T
        beta = np.arctan2(dy, dx)[:, None] - pose[2] + 2.0 * np.pi * np.arange(-9, 10)
        edges = (norm.cdf(end, beta, sigma).sum(axis=1) for end in (fov / 2.0, -fov / 2.0))
        v = np.subtract(*edges)
        wanted[k] = np.log1p(-0.7 * (0.05 + 0.95 * v)).sum()
    assert missed == pytest.approx(wanted, abs=1e-6)


def test_a_robot_that_misses_what_it_would_see_is_elsewhere():
    """Both places see landmark 2 alike, one with three others in reach, one with them all out of
    it: each miss weighs 1 − p_detect.
    """
    both = np.array([[1.35, 0.4, np.pi / 2.0], [1.35, 3.4, -np.pi / 2.0]]).T
    sensor = LandmarkModel(Landmarks.numbered(PLACES), sigma_relative=0.0, range_max=4.0)
    z = seen([2], [1.5], [0.0])
    assert np.ptp(sensor.log_likelihood(both, z)) == pytest.approx(0.0, abs=1e-12)
    within = np.hypot(*(PLACES[[0, 1, 3], :, None] - both[:2]).swapaxes(0, 1)) < 4.0
    sees = replace(sensor, p_detect=0.9)
    near, far = sees.log_likelihood(both, z)
    misses = within.sum(axis=0)
    assert misses.tolist() == [2, 1]
    # Those out of view are seen with chance ε p_detect: next to nothing.
    assert near - far == pytest.approx(math.log(0.1), abs=0.1)


def smooth(landmarks, **settings):
    """A model that midpoints on a coarse grid integrate well."""
    return LandmarkModel(
        Landmarks.numbered(landmarks),
        sigma_range=0.3,
        sigma_bearing=0.4,
        range_max=3.0,
        p_outlier=0.05,
        fov=1.2,
        **settings,
    )


def integral(sensor, pose, landmark):
    """∫∫ p(r, b | x) dr db over the ranges and bearings that can be measured, but for p_detect."""
    n, m = 120, 60
    total, x = 0.0, np.array(pose)[:, None]
    for r in (np.arange(n) + 0.5) * sensor.range_max / n:
        best = sensor.range_density(r, np.array(r)) * sensor.bearing_density(np.zeros(1))[0]
        for b in (np.arange(m) + 0.5) * 2.0 * np.pi / m:
            total += best * math.exp(sensor.log_likelihood(x, seen([landmark], [r], [b]))[0])
    return total * sensor.range_max / n * 2.0 * np.pi / m


def unmeasured(sensor, pose):
    """(L,): the chance that the range of each landmark is none that is measured."""
    d = np.hypot(*(sensor.places - pose[:2]).T)
    sigma = np.hypot(sensor.sigma_range, sensor.sigma_relative * d)
    beyond = norm.cdf(0.0, d, sigma) + norm.sf(sensor.range_max, d, sigma)
    return (1.0 - sensor.p_outlier) * beyond


@pytest.mark.parametrize("landmark", [2, UNKNOWN])
@pytest.mark.parametrize("pose", [(0.3, 0.5, 0.9), (2.0, -1.0, 3.0), (9.0, 9.0, 0.0)], ids=str)
def test_a_sighting_integrates_to_1(landmark, pose):
    """Over ranges and bearings, and the atom of ranges that are none."""
    sensor = smooth(PLACES, p_false=0.2)
    atom = unmeasured(sensor, pose)
    if landmark == UNKNOWN:
        v = view(sensor, pose)
        none = 0.8 * min(v.sum(), 1.0) * (v @ atom) / v.sum()
    else:
        none = 0.8 * atom[landmark]
    assert integral(sensor, pose, landmark) + none == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("pose", [(0.3, 0.5, 0.9), (0.3, 0.5, -2.0)], ids=str)
def test_what_is_seen_and_what_is_missed_integrate_to_1(pose):
    """One landmark: seen with any range and bearing, seen without a range, or missed."""
    sensor = smooth(np.add(PLACES[:1], [0.0, 1.0]), p_detect=0.7)
    missed = math.exp(sensor.log_likelihood(np.array(pose)[:, None], seen([], [], []))[0])
    detected = 1.0 - missed
    none = detected * unmeasured(sensor, pose)[0]
    assert 0.7 * integral(sensor, pose, 0) + none + missed == pytest.approx(1.0, abs=2e-3)
    assert detected == pytest.approx(0.7 * (0.05 + 0.95 * view(sensor, pose)[0]))
