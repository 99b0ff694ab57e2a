"""KLD-sampling: Fox's bound, and the exact index at which drawing stops."""

import numpy as np
import pytest
from scipy.stats import chi2, norm

from mcloc.errors import ConfigError
from mcloc.filters.drawing import draw
from mcloc.protocols import Weighed
from mcloc.sample_size import KLD, Fixed
from mcloc.statespace import LINE, SE2


@pytest.mark.parametrize("epsilon", [0.01, 0.05])
@pytest.mark.parametrize("delta", [0.01, 0.1])
@pytest.mark.parametrize("bins", [2, 3, 10, 100, 5000])
def test_bound_is_that_of_fox(epsilon, delta, bins):
    """IJRR 2003, and what it approximates to 1 % from 9 degrees on: the χ² quantile."""
    bound = KLD(epsilon=epsilon, delta=delta).bound(bins)
    k, z = bins - 1, norm.ppf(1.0 - delta)
    fox = k / (2.0 * epsilon) * (1.0 - 2.0 / (9.0 * k) + np.sqrt(2.0 / (9.0 * k)) * z) ** 3
    assert bound == pytest.approx(fox)
    if k >= 9:
        assert bound == pytest.approx(chi2.ppf(1.0 - delta, k) / (2.0 * epsilon), rel=0.01)


def stopping_index(states, rule, sides):
    """The first n with n ≥ bound(occupied bins among the first n), limits included."""
    seen = set()
    for n, x in enumerate(states.T, 1):
        seen.add(tuple(np.floor(x / sides)))
        if n >= min(max(rule.bound(len(seen)), rule.minimum), rule.maximum):
            return n
    raise AssertionError("the states do not suffice")


def feed(rule, space, states, chunk):
    counter, done = rule.counter(space, 0, 0), 0
    while True:
        part = np.ascontiguousarray(states[:, done : done + chunk])
        enough = counter.enough(part, np.zeros(part.shape[1]))
        if enough is not None:
            return done + enough
        done += chunk


SIDES = {"bin_length": 0.25, "bin_angle": 0.17}
RULES = [
    KLD(**SIDES, epsilon=0.02),
    KLD(**SIDES, epsilon=0.1, minimum=20),
    KLD(**SIDES, epsilon=0.1, minimum=3000),
    KLD(**SIDES, epsilon=0.02, minimum=10, maximum=700),
    Fixed(777),
]


@pytest.mark.parametrize("chunk", [1, 7, 1024, 30_000])
@pytest.mark.parametrize("rule", RULES, ids=str)
def test_drawing_stops_at_the_exact_index_whatever_the_chunk(rule, chunk):
    rng = np.random.default_rng(3)
    states = rng.normal(0.0, [[0.3], [0.3], [0.15]], (3, 30_000))
    sides = np.array([0.25, 0.25, 0.17])
    expected = rule.particles if isinstance(rule, Fixed) else stopping_index(states, rule, sides)
    assert feed(rule, SE2, states, chunk) == expected

    def source(first, n):
        weights = np.arange(float(first), first + n)
        return Weighed(states[:, first : first + n], np.zeros(n), weights)

    drawn = draw(source, rule.counter(SE2, 0, 0), rule.fixed, rule.fixed)
    assert np.array_equal(drawn.states, states[:, :expected])
    assert np.array_equal(drawn.log_weights, np.arange(float(expected)))


def test_axes_have_the_sides_of_their_kind():
    """Particles 0.3 m apart: bins of 0.25 m hold one each, bins of 1 m three or four."""
    states = 0.3 * np.arange(40.0)[None] + 0.01
    narrow, wide = (KLD(epsilon=1.0, delta=0.5, bin_length=b, minimum=1) for b in (0.25, 1.0))
    assert feed(narrow, LINE, states, 1) == stopping_index(states, narrow, np.array([0.25]))
    assert feed(wide, LINE, states, 1) == stopping_index(states, wide, np.array([1.0]))


def test_one_bin_needs_no_more_than_the_minimum():
    assert feed(KLD(minimum=12), SE2, np.full((3, 100), 0.01), 5) == 12


def test_a_maximum_below_the_minimum_is_refused():
    with pytest.raises(ConfigError, match=r"KLD\.maximum = 20 must be >= minimum = 50"):
        KLD(minimum=50, maximum=20)


@pytest.mark.parametrize("particles", [0, -3, 2.5])
def test_a_number_of_particles_that_cannot_be(particles):
    with pytest.raises(ConfigError, match=r"Fixed\.particles"):
        Fixed(particles)
