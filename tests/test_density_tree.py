"""Density trees: a density that integrates to 1 and is what is sampled from."""

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.stats import chisquare, kstest

from mcloc.density_tree import DensityTree, leaf_size
from mcloc.draws import Draws
from mcloc.errors import ConfigError, FilterError
from mcloc.geometry import wrap
from mcloc.kernels import jit
from mcloc.particles import Particles
from mcloc.statespace import LINE, R3, SE2, StateSpace

HEADED = StateSpace(("x", "theta"), ("m", "rad"), (False, True))
BODY = StateSpace(tuple("xyzrpw"), ("m",) * 3 + ("rad",) * 3, (False,) * 3 + (True,) * 3)
TRAILED = StateSpace(
    ("x", "y", "theta", "hitch"), ("m", "m", "rad", "rad"), (False, False, True, True)
)
SPACES = [LINE, HEADED, SE2, R3, TRAILED, BODY]


def particles_in(space, n=2000, seed=1):
    """Weighted particles on two hills, one of them across the seam of every circle."""
    rng = np.random.default_rng(seed)
    circular = np.array(space.circular)
    deviation = rng.uniform(0.05, 0.5, (space.dimension, 1))
    x = deviation * rng.normal(size=(space.dimension, n))
    x[:, n // 3 :] += 3.0
    x[circular] = wrap(x[circular])
    return Particles.normalized(x, np.log(rng.exponential(size=n)))


@pytest.fixture(params=SPACES, ids=lambda s: "-".join(s.axes))
def tree(request):
    return DensityTree.fit(particles_in(request.param), request.param)


@pytest.fixture
def threads() -> Iterator[None]:
    before = jit._threads
    yield
    jit.set_threads(before)


def leaves_of(tree):
    return np.flatnonzero(tree.child == np.arange(len(tree.child)))


def unit(tree, x):
    """(D, n): coordinates within the root box, in plain NumPy."""
    u = (x - tree.low[:, None]) / tree.side[:, None]
    u[np.array(tree.space.circular)] %= 1.0
    return u


def leaf_around(tree, x):
    """(n,): the leaf whose box holds each point of the root box."""
    leaves = leaves_of(tree)
    low, high = tree.corner[leaves], (tree.corner + tree.width)[leaves]
    u = unit(tree, x).T[:, None]
    held = ((u >= low) & (u < high)).all(axis=2)
    assert (held.sum(axis=1) == 1).all()
    return leaves[held.argmax(axis=1)]


def test_leaves_hold_the_weight_of_the_particles_in_them_and_a_floor(tree):
    particles = particles_in(tree.space)
    around = leaf_around(tree, particles.states)
    weight = np.bincount(around, particles.weights, len(tree.child))
    volume = tree.width.prod(axis=1)
    leaves = leaves_of(tree)
    expected = np.zeros(len(weight))
    expected[leaves] = (0.99 * weight + 0.01 * volume)[leaves]
    assert tree.mass == pytest.approx(expected, rel=1e-10, abs=1e-300)
    held = np.bincount(around, minlength=len(weight))
    assert held.max() <= leaf_size(2000, tree.space.dimension)


def test_the_density_is_mass_by_volume_and_0_outside(tree):
    rng = np.random.default_rng(3)
    x = (tree.low + tree.side * rng.random((500, len(tree.low)))).T
    x = np.concatenate([x, particles_in(tree.space).states[:, :500]], axis=1)
    leaf = leaf_around(tree, x)
    density = tree.mass[leaf] / (tree.width[leaf] * tree.side).prod(axis=1)
    assert np.exp(tree.log_density(x)) == pytest.approx(density, rel=1e-9)
    x[0] += np.where(x[0] > 0.0, 1.0, -1.0) * tree.side[0]
    x[0, :2] = -np.inf, np.inf
    assert np.isneginf(tree.log_density(x)).all()


def test_it_integrates_to_one(tree):
    volume = (tree.width * tree.side).prod(axis=1)
    assert (np.exp(tree.log_values) * volume).sum() == pytest.approx(1.0, rel=1e-12)


def test_it_integrates_to_one_on_a_line():
    tree = DensityTree.fit(particles_in(LINE), LINE)
    edges = np.linspace(tree.low[0] - 1.0, tree.low[0] + tree.side[0] + 1.0, 100_001)
    density = np.exp(tree.log_density(0.5 * (edges[1:] + edges[:-1])[None]))
    step = edges[1] - edges[0]
    # A jump within a step is taken half a step too early or too late, at most.
    error = 0.5 * step * np.abs(np.diff(density)).sum()
    assert error < 1e-3
    assert abs(density.sum() * step - 1.0) <= error + 1e-9


def test_it_integrates_to_one_around_a_circle():
    tree = DensityTree.fit(particles_in(HEADED), HEADED)
    rng, n = np.random.default_rng(4), 400_000
    x = np.stack([tree.low[0] + tree.side[0] * rng.random(n), np.pi * (1.0 - 2.0 * rng.random(n))])
    share = np.exp(tree.log_density(x)) * tree.side[0] * 2.0 * np.pi
    assert share.std() / np.sqrt(n) < 0.01
    assert abs(share.mean() - 1.0) < 4.0 * share.std() / np.sqrt(n)


def test_samples_are_of_the_density(tree):
    """Leaves as often as their mass says, places within a leaf evenly, on each axis."""
    n = 20_000
    x = tree.sample(Draws(5), 0, n)
    circular = np.array(tree.space.circular)
    assert (np.abs(x[circular]) <= np.pi).all()
    leaf = np.concatenate([leaf_around(tree, part) for part in np.array_split(x, 20, axis=1)])
    counts, expected = np.bincount(leaf, minlength=len(tree.mass)), n * tree.mass
    rare = expected < 5.0
    counts = np.append(counts[~rare], counts[rare].sum())
    expected = np.append(expected[~rare], expected[rare].sum())
    used = expected > 0.0
    assert used.sum() > 20
    assert chisquare(counts[used], expected[used]).pvalue > 1e-3
    for within in ((unit(tree, x).T - tree.corner[leaf]) / tree.width[leaf]).T:
        assert kstest(within, "uniform").pvalue > 1e-3


def test_samples_do_not_depend_on_chunks(tree):
    whole = tree.sample(Draws(6, 2, 1), 0, 10)
    parts = [tree.sample(Draws(6, 2, 1), first, n) for first, n in ((0, 4), (4, 6))]
    assert np.array_equal(whole, np.concatenate(parts, axis=1))
    assert len(np.unique(whole)) == whole.size


def test_bits_do_not_depend_on_threads(tree, threads):
    x = tree.sample(Draws(7), 0, 20_000)
    results = []
    for n in (1, 2, 3):
        jit.set_threads(n)
        again = DensityTree.fit(particles_in(tree.space), tree.space)
        results.append(again.log_density(x))
    assert np.isfinite(results[0]).all()
    assert np.array_equal(results[0], results[1])
    assert np.array_equal(results[0], results[2])


def test_importance_weights_are_bounded_by_the_floor(tree):
    rng = np.random.default_rng(8)
    x = (tree.low + tree.side * rng.random((1000, len(tree.low)))).T
    assert tree.log_density(x).min() >= np.log(0.01 / tree.side.prod()) - 1e-9


def test_without_a_floor_empty_leaves_have_no_density():
    tree = DensityTree.fit(particles_in(R3), R3, floor=0.0)
    rng = np.random.default_rng(8)
    x = (tree.low + tree.side * rng.random((1000, 3))).T
    assert np.isneginf(tree.log_density(x)).any()
    assert np.isfinite(tree.log_density(particles_in(R3).states)).all()


def test_a_turned_and_moved_belief_has_the_turned_and_moved_density():
    """The circle is cut opposite to the mean, not at a place of its own."""
    particles = particles_in(SE2)
    move = np.array([[20.0], [-7.0], [2.0]])
    moved = particles.states + move
    moved[2] = wrap(moved[2])
    before = DensityTree.fit(particles, SE2)
    after = DensityTree.fit(Particles(moved, particles.log_weights), SE2)
    x = before.sample(Draws(9), 0, 2000)
    # All but points within rounding of an edge, of which there are none among these.
    assert after.log_density(x + move) == pytest.approx(before.log_density(x), abs=1e-9)


def test_weights_count_and_zero_ones_too():
    """Of two places as often sampled one weighs nothing: only the floor is left there."""
    x = np.random.default_rng(12).random((1, 2000))
    log_weights = np.where(x[0] < 0.5, 0.0, -np.inf)
    tree = DensityTree.fit(Particles.normalized(x, log_weights), LINE, leaf=400)
    low, high = np.exp(tree.log_density([[0.2, 0.8]]))
    # Leaves are eighths, of 250 ± 15 samples: quarters hold 500 ± 19. 4 deviations.
    assert low == pytest.approx(0.99 * 2.0 + 0.01, rel=4.0 / np.sqrt(250.0))
    assert high == pytest.approx(0.01, rel=0.01)


@pytest.mark.parametrize("n", [1, 500])
@pytest.mark.parametrize("space", SPACES, ids=lambda s: "-".join(s.axes))
def test_identical_particles_get_a_box_of_a_least_side(space, n):
    at = np.full((space.dimension, 1), 2.5)
    tree = DensityTree.fit(Particles.equal(np.repeat(at, n, axis=1)), space)
    leaf = leaf_around(tree, at)[0]
    sides = tree.width[leaf] * tree.side
    straight = ~np.array(space.circular)
    assert sides[straight] == pytest.approx(1e-3)
    assert (sides >= 1e-3 * (1.0 - 1e-12)).all()
    assert sides[~straight] == pytest.approx(2e-3 if n > 1 else 2.0 * np.pi, rel=0.5)
    expected = (0.99 + 0.01 * tree.width[leaf].prod()) / sides.prod()
    assert np.exp(tree.log_density(at)) == pytest.approx(expected)
    near = tree.sample(Draws(13), 0, 50)[straight]
    assert np.abs(near - 2.5).max() <= 0.5e-3 + 1e-12


def test_far_hills_of_many_halvings_find_room():
    """Two places 10⁶ m apart on three axes, with many identical particles each."""
    x = np.repeat(np.stack([np.zeros(6), [1e6, 1e6, 1e6, 2.0, 2.0, 2.0]], axis=1), 500, axis=1)
    tree = DensityTree.fit(Particles.equal(x), BODY, leaf=400)
    # Sides of 10⁶ m are halved 29 times or more to less than 2 · 10⁻³ m, in each of two places.
    assert len(tree.child) > 2 * 2 * 3 * 28
    shares = np.sort(tree.mass)[::-1]
    assert shares[:2] == pytest.approx([0.495, 0.495], rel=1e-6)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_states_and_weights_that_are_no_numbers_are_refused(bad):
    x, log_weights = np.zeros((3, 5)), np.full(5, -np.log(5.0))
    x[1, 3] = bad
    with pytest.raises(FilterError, match="finite states"):
        DensityTree.fit(Particles(x, log_weights), SE2)
    if bad == -np.inf:
        log_weights[:] = bad
    log_weights[2] = bad
    with pytest.raises(FilterError, match="weights"):
        DensityTree.fit(Particles(np.zeros((3, 5)), log_weights), SE2)


def test_what_cannot_be_asked_for_is_refused():
    particles = particles_in(SE2, 50)
    with pytest.raises(FilterError, match="of 1 axes"):
        DensityTree.fit(particles, LINE)
    with pytest.raises(FilterError, match="at least one"):
        DensityTree.fit(Particles(np.empty((3, 0)), np.empty(0)), SE2)
    for wrong in ({"floor": -0.1}, {"floor": 1.0}, {"leaf": 0}, {"least_side": 0.0}):
        with pytest.raises(ConfigError, match="floor"):
            DensityTree.fit(particles, SE2, **wrong)
    tree = DensityTree.fit(particles, SE2)
    for bad in ([0.0, np.nan, 0.0], [0.0, 0.0, np.inf]):
        with pytest.raises(FilterError, match="NaN"):
            tree.log_density(np.array([bad]).T)
    with pytest.raises(FilterError, match=r"\(3, n\)"):
        tree.log_density(np.zeros((1, 3)))
