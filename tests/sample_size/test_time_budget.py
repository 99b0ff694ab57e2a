"""As many particles as the time allows, by a clock that a test sets."""

import numpy as np
import pytest

from mcloc.filters.drawing import LEAST_CHUNK, draw
from mcloc.protocols import Weighed
from mcloc.sample_size import TimeBudget
from mcloc.statespace import LINE


class Clock:
    """Time passes while particles are drawn: so much for each."""

    def __init__(self, per_particle):
        self.now, self.per_particle = 100.0, per_particle

    def __call__(self):
        return self.now

    def source(self, first, n):
        self.now += n * self.per_particle
        return Weighed(np.arange(float(first), first + n)[None], np.zeros(n), np.zeros(n))


def drawn(clock, **limits):
    rule = TimeBudget(budget=1.0, clock=clock, **limits)
    states = draw(clock.source, rule.counter(LINE, 1, 0), rule.fixed, None).states[0]
    assert np.array_equal(states, np.arange(float(len(states))))
    return len(states)


@pytest.mark.parametrize("affordable", [3_000, 10_000, 70_000])
def test_the_budget_is_used_and_passed_by_one_chunk_at_most(affordable):
    n = drawn(Clock(1.0 / affordable), minimum=10, maximum=1_000_000)
    assert affordable <= n <= affordable + max(LEAST_CHUNK, affordable / 4)


def test_a_slow_machine_draws_the_minimum_all_the_same():
    assert 3_000 <= drawn(Clock(1.0), minimum=3_000, maximum=10_000) < 3_000 + LEAST_CHUNK


@pytest.mark.parametrize("maximum", [1, LEAST_CHUNK, LEAST_CHUNK + 1, 5_000])
def test_a_fast_machine_draws_the_maximum_and_no_more(maximum):
    assert drawn(Clock(0.0), minimum=1, maximum=maximum) == maximum


def test_each_set_has_the_whole_budget():
    clock = Clock(1.0 / 5_000)
    sizes = [drawn(clock, minimum=10, maximum=1_000_000) for _ in range(2)]
    assert sizes[0] == sizes[1] >= 5_000


def test_the_clock_is_that_of_the_machine_where_none_is_given():
    """A budget that has passed at once: the first chunk is the set."""
    rule = TimeBudget(budget=1e-9, minimum=1)
    assert rule.counter(LINE, 1, 0).enough(np.zeros((1, 50)), np.zeros(50)) == 50
