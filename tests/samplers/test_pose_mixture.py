"""The Gaussian mixture over poses: its density against SciPy's, samples against it."""

import numpy as np
import pytest
from scipy.stats import chi2, chisquare, kstest, norm, truncnorm

from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.geometry import compose, inverse, wrap
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.samplers.pose_mixture import CUT, PoseMixture, Spread

SPREADS = {"narrow": Spread(0.15, 0.2), "all headings": Spread(0.2, 1.9), "tiny": Spread(1e-3, 0.3)}
every_spread = pytest.mark.parametrize("spread", SPREADS.values(), ids=SPREADS)
MOUNTS = {"centred": np.zeros(3), "mounted": np.array([0.3, -0.2, 2.8])}
MEANS = np.array([[6.0, 6.1, 5.2, 6.8], [-2.0, -1.8, -1.1, -2.3], [0.3, np.pi, -3.1, 1.0]])
WEIGHTS = np.array([0.4, 0.3, 0.2, 0.1])
FLOOR = 0.3


def world():
    cells = np.full((40, 40), FREE, dtype=np.int8)
    cells[10:12] = OCCUPIED
    return FreeSpace(OccupancyGrid(cells, 0.1, np.array([4.5, -4.0, 0.3])))


def mixture(spread, mount, weights=WEIGHTS, fit=None, looks=4000):
    model = MEANS[:, : len(weights)], weights, spread, world(), FLOOR, mount
    return PoseMixture(*model, fit, Draws(8), looks)


def density_by_scipy(x, spread):
    """(n,): the components alone, of sensors."""
    plane, heading = spread.cuts
    total = np.zeros(x.shape[1])
    for mean, weight in zip(MEANS.T, WEIGHTS, strict=True):
        d = np.hypot(x[0] - mean[0], x[1] - mean[1]) / spread.position
        within = chi2(2).cdf(plane**2)
        plane_density = norm.pdf(d) * norm.pdf(0.0) / spread.position**2 / within
        off = wrap(x[2] - mean[2])
        of_heading = truncnorm(-heading, heading, scale=spread.heading).pdf(off)
        total += np.where(d <= plane, weight * plane_density * of_heading, 0.0)
    return total


@every_spread
@pytest.mark.parametrize("mount", MOUNTS.values(), ids=MOUNTS)
def test_the_density_is_that_of_truncated_gaussians(spread, mount):
    q = mixture(spread, mount)
    rng = np.random.default_rng(1)
    reach = 4.0 * spread.position
    sensor = MEANS[:, rng.integers(0, 4, 3000)] + rng.uniform(-1.0, 1.0, (3, 3000)) * np.array(
        [[reach], [reach], [np.pi]]
    )
    sensor[2] = wrap(sensor[2])
    x = np.ascontiguousarray(compose(sensor.T, inverse(mount)).T)
    expected = 0.7 * density_by_scipy(sensor, spread) + 0.3 * np.exp(world().log_density(x))
    sides = [np.hypot(*(sensor[:2] - m[:2, None])) / spread.position for m in MEANS.T]
    inside = (np.abs(np.array(sides) - CUT) > 1e-5).all(axis=0)  # not where rounding decides
    assert np.exp(q.log_density(x))[inside] == pytest.approx(expected[inside], rel=1e-9)
    assert (density_by_scipy(sensor, spread) > 0.0).mean() > 0.05


def test_it_integrates_to_one():
    """Over a lattice 0.02 m and 2 degrees fine; its error is that of the edges of the discs, some
    10 % of a step where the density is 1 % of that in the middle.
    """
    q = mixture(SPREADS["narrow"], MOUNTS["mounted"])
    step, turn = 0.02, np.deg2rad(2.0)
    axes = np.arange(3.0, 9.0, step), np.arange(-5.0, 2.0, step)
    x, y = (a.ravel() for a in np.meshgrid(*axes))
    total = 0.0
    for theta in np.arange(-np.pi + 0.5 * turn, np.pi, turn):
        poses = np.stack([x, y, np.full(len(x), theta)])
        total += np.exp(q.log_density(poses)).sum() * step**2 * turn
    assert total == pytest.approx(1.0, abs=2e-3)


@every_spread
def test_poses_around_a_mean_are_truncated_gaussian(spread):
    """Distance, direction and heading, each by its own cumulative density."""
    n, mean = 20_000, MEANS[:, 1]
    u = np.random.default_rng(2).random((3, n))
    x = spread.around(np.repeat(mean[:, None], n, axis=1), u)
    dx, dy = x[0] - mean[0], x[1] - mean[1]
    square = (dx**2 + dy**2) / spread.position**2
    plane, heading = spread.cuts
    assert square.max() <= plane**2 * (1.0 + 1e-9)
    assert (np.abs(x[2]) <= np.pi).all()
    assert kstest(chi2(2).cdf(square) / chi2(2).cdf(plane**2), "uniform").pvalue > 1e-3
    assert kstest(np.arctan2(dy, dx) / (2.0 * np.pi) + 0.5, "uniform").pvalue > 1e-3
    of_heading = truncnorm(-heading, heading, scale=spread.heading)
    assert kstest(wrap(x[2] - mean[2]), of_heading.cdf).pvalue > 1e-3


@pytest.mark.parametrize("mount", MOUNTS.values(), ids=MOUNTS)
def test_samples_are_of_the_density(mount):
    """Counts in squares of 0.5 m and quarters of the circle, against the density's integral over
    uniform poses; both have an error, which is taken into account.
    """
    q, n, many = mixture(SPREADS["narrow"], mount), 40_000, 2_000_000
    rng = np.random.default_rng(3)
    low, side = np.array([[3.0], [-5.0], [-np.pi]]), np.array([[6.0], [7.0], [2.0 * np.pi]])

    def bins(x):
        at = np.floor((x - low) / np.array([[0.5], [0.5], [0.5 * np.pi]])).astype(int)
        assert (at >= 0).all()
        return np.ravel_multi_index(at, (12, 14, 4), mode="clip")

    y = low + side * rng.random((3, many))
    mass = np.exp(q.log_density(y)) * side.prod() / many
    expected, squares = (np.bincount(bins(y), w, 12 * 14 * 4) for w in (mass, mass**2))
    counts = np.bincount(bins(q.sample(Draws(6), 0, n)), minlength=len(expected))
    often = n * expected > 10.0
    assert expected[often].sum() > 0.9
    off = (counts - n * expected)[often]
    variance = (n * expected + n**2 * squares)[often]
    assert (off**2 / variance).sum() < chi2(often.sum()).ppf(0.999)


@every_spread
@pytest.mark.parametrize("mount", MOUNTS.values(), ids=MOUNTS)
def test_samples_weigh_as_the_density_says(spread, mount):
    """E[f / q̄] = ∫ f, f = U (1 + cos θ): wherever U is, q̄ is at least a share of it."""
    q, n = mixture(spread, mount), 40_000
    x = q.sample(Draws(7), 0, n)
    u = np.exp(q.environment.log_density(x))
    weight = u * (1.0 + np.cos(x[2])) / np.exp(q.log_density(x))
    assert weight.max() <= 2.0 / FLOOR + 1e-9
    assert abs(weight.mean() - 1.0) < 4.0 * weight.std() / np.sqrt(n)


@every_spread
@pytest.mark.parametrize("mount", MOUNTS.values(), ids=MOUNTS)
def test_no_sample_is_where_the_density_is_zero(spread, mount):
    """Not even at the edge of a disc, far from the origin of the map: a weight of 1/0 is none."""
    q = mixture(spread, mount)
    assert np.isfinite(q.log_density(q.sample(Draws(9), 0, 100_000))).all()
    edge = np.repeat(MEANS[:, :1], 7, axis=1) + 1e4
    u = np.stack([np.full(7, 1.0 - 2.0**-33), np.linspace(0.0, 0.99, 7), np.full(7, 2.0**-33)])
    moved = PoseMixture(edge[:, :1], np.ones(1), spread, world(), FLOOR, np.zeros(3), None, None, 1)
    x = spread.around(edge, u)
    assert np.isfinite(moved.log_density(x)).all()


def test_components_are_chosen_by_their_weights():
    q, n = mixture(Spread(1e-3, 0.01), np.zeros(3)), 20_000
    x = q.sample(Draws(4), 0, n)
    near = [np.hypot(*(x[:2] - m[:2, None])) < 4e-3 for m in MEANS.T]
    counts = np.array([*(k.sum() for k in near), n - np.sum(near)])
    assert chisquare(counts, n * np.append(0.7 * WEIGHTS, 0.3)).pvalue > 1e-3


def test_without_components_it_is_uniform():
    q = mixture(SPREADS["narrow"], MOUNTS["mounted"], np.empty(0))
    x = q.sample(Draws(2), 5, 50)
    assert np.array_equal(x, world().sample(Draws(2), 5, 50))
    assert q.log_density(x) == pytest.approx(world().log_density(x))


def test_chunks_do_not_matter():
    q = mixture(SPREADS["narrow"], MOUNTS["mounted"])
    whole = q.sample(Draws(3, 2, 1), 40, 200)
    parts = [q.sample(Draws(3, 2, 1), 40 + a, b - a) for a, b in ((0, 1), (1, 77), (77, 200))]
    assert np.array_equal(whole, np.concatenate(parts, axis=1))


@pytest.mark.parametrize("mount", MOUNTS.values(), ids=MOUNTS)
def test_log_pi_is_the_integral_of_the_fit(mount):
    """Of one that is U times 1 + cos θ: 1, but for what samples err by."""

    def fit(x):
        with np.errstate(divide="ignore"):
            return world().log_density(x) + np.log1p(np.cos(x[2]))

    q = mixture(SPREADS["narrow"], mount, fit=fit, looks=20_000)
    # Weights are from 0 to 2 / floor.
    assert q.log_pi == pytest.approx(0.0, abs=4.0 * (1.0 / FLOOR) / np.sqrt(20_000))
