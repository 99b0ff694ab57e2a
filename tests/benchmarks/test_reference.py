"""The reference does the same work: its results are those of the kernels, and of SciPy.

That is what pins it: a reference that were made slower by doing more, or faster by doing less,
would not agree.
"""

import numpy as np
import pytest
from scipy.stats import chi2

from mcloc.benchmarks import reference, reference_filter
from mcloc.benchmarks.operations import DRAWS, OPERATIONS, Case
from mcloc.benchmarks.scene import MOVE, Scene, demo_map
from mcloc.motion.odometry import OdometryMotion
from mcloc.particles import Particles
from mcloc.resampling import comb
from mcloc.sample_size import KLD
from mcloc.statespace import SE2

N, BEAMS = 400, 20


@pytest.fixture(scope="module")
def scene():
    return Scene.on(demo_map())


def both(name, scene, cloud, n=N, beams=BEAMS):
    work = OPERATIONS[name](Case(scene, cloud, n, beams))
    return work.ours(), work.reference()


@pytest.mark.parametrize("cloud", ["tracking", "uniform"])
def test_the_likelihood_field(scene, cloud):
    ours, theirs = both("likelihood_field", scene, cloud)
    # Both read the same 16 bits; in float32 a few endpoints fall into the next cell.
    assert np.mean(np.abs(ours - theirs) > 1e-9) < 0.02


@pytest.mark.parametrize("cloud", ["tracking", "uniform"])
def test_cast_beams(scene, cloud):
    ours, theirs = both("beam_cast", scene, cloud)
    assert ours == pytest.approx(theirs, abs=1e-3)  # sums in float32's table, else the same


@pytest.mark.parametrize("cloud", ["tracking", "uniform"])
def test_looked_up_beams(scene, cloud):
    ours, theirs = both("beam_table", scene, cloud)
    # A heading within 10⁻⁵ of half an angle may be rounded to either side in float32.
    assert np.mean(np.abs(ours - theirs) > 1e-4) < 0.02


def test_motion(scene):
    """Means and covariances of 20,000 moves: the noise is not the same, its distribution is."""
    x = np.zeros((3, 20_000))
    model = OdometryMotion()
    d = model.decompose(MOVE)
    drive = (d.rot1, d.trans, d.rot2, d.sd_rot1, d.sd_trans, d.sd_rot2)
    ours = model.sample(x, MOVE, DRAWS, 0)
    theirs = reference.moved(x, drive, np.random.default_rng(1))
    spread = np.cov(ours) / x.shape[1] + np.cov(theirs) / x.shape[1]
    apart = ours.mean(axis=1) - theirs.mean(axis=1)
    assert apart @ np.linalg.solve(spread, apart) < chi2(3).ppf(1.0 - 1e-4)
    deviation = np.sqrt(np.diag(np.cov(ours)))
    # Each of two covariances of Gaussians has a deviation of at most √(2/n) σ_a σ_b.
    bound = 4.5 * 2.0 / np.sqrt(x.shape[1]) * np.outer(deviation, deviation)
    assert (np.abs(np.cov(theirs) - np.cov(ours)) < bound).all()


def test_resampling(scene):
    """At the same offset, the same ancestors."""
    weights = np.random.default_rng(2).exponential(size=N)
    particles = Particles.normalized(np.zeros((3, N)), np.log(weights))
    offset = 0.37
    theirs = reference.systematic(particles.weights, offset, N)
    assert np.array_equal(comb(particles.weights, offset, N), theirs)


@pytest.mark.parametrize("cloud", ["tracking", "uniform"])
def test_the_size_of_kld_sampling(scene, cloud):
    x, rule = scene.cloud(cloud, 5000), KLD(minimum=100, maximum=4000, epsilon=0.1)
    sides = np.array([rule.bin_length, rule.bin_length, rule.bin_angle])
    theirs = reference.kld_size(x, sides, rule.epsilon, rule.delta, (100, 4000))
    assert rule.counter(SE2, 0, 0).enough(x, np.zeros(5000)) == theirs
    assert 100 <= theirs <= 4000


@pytest.mark.parametrize("cloud", ["tracking", "uniform"])
def test_hypotheses(scene, cloud):
    ours, theirs = both("estimate", scene, cloud)
    assert [h.share for h in ours] == pytest.approx([share for _, _, share in theirs])
    for h, (mean, covariance, _) in zip(ours, theirs, strict=True):
        assert h.mean == pytest.approx(mean)
        assert h.covariance == pytest.approx(covariance, abs=1e-12)


@pytest.mark.parametrize("name", ["step_fixed", "step_adaptive"])
def test_steps(scene, name):
    """Another noise, the same belief: the ESS, the likelihood and the pose to within sampling."""
    (found, ess, evidence), (poses, their_ess, likelihood) = both(name, scene, "tracking", 20_000)
    assert ess == pytest.approx(their_ess, rel=0.1)
    assert evidence.fast == pytest.approx(likelihood, rel=0.05)
    assert found[0].mean == pytest.approx(poses[0][0], abs=0.02)
    assert found[0].share == pytest.approx(poses[0][2], abs=0.05)


def test_the_distance_transform(scene):
    ours, theirs = both("distance_transform", scene, "tracking")
    assert np.array_equal(ours, np.rint(theirs**2))


def test_the_density_tree(scene):
    """Another way to choose its boxes, so another density; but both integrate to 1, and both are
    near that of a Gaussian where it is.
    """
    rng = np.random.default_rng(3)
    spread = np.array([[0.4], [0.3], [0.2]])
    x, places = (spread * rng.standard_normal((3, 20_000)) for _ in range(2))
    weights = np.full(x.shape[1], 1.0 / x.shape[1])
    box = np.array([[-2.0], [-2.0], [-np.pi]]), np.array([[2.0], [2.0], [np.pi]])
    anywhere = rng.uniform(*box, (3, 200_000))
    density = np.exp(reference_filter.density_tree(x, weights, anywhere, 50))
    volume = 4.0 * 4.0 * 2.0 * np.pi
    error = volume * density.std() / np.sqrt(density.size)
    assert volume * density.mean() == pytest.approx(1.0, abs=4.5 * error)
    exact = -0.5 * ((places / spread) ** 2).sum(axis=0) - np.log(spread * np.sqrt(2 * np.pi)).sum()
    found = np.exp(reference_filter.density_tree(x, weights, places, 50) - exact)
    assert 0.8 < np.median(found) < 1.2
