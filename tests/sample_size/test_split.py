"""A fixed number of particles, divided among two parts by chance."""

import numpy as np
import pytest

from mcloc.errors import ConfigError
from mcloc.sample_size.split import Split
from mcloc.statespace import LINE


def size(rule: Split, step: int) -> int:
    enough = rule.counter(LINE, step, 0).enough(np.zeros((1, 10**4)), np.zeros(10**4))
    assert enough is not None
    return enough


def test_both_parts_have_all_particles_at_each_step():
    one, other = Split(particles=500, phi=0.1), Split(particles=500, phi=0.1, rest=True)
    assert all(size(one, step) + size(other, step) == 500 for step in range(1, 50))


def test_the_share_is_binomial():
    """Mean and variance over 400 steps within 4.5 standard errors."""
    sizes = np.array([size(Split(particles=1000, phi=0.1), step) for step in range(1, 401)])
    assert sizes.mean() == pytest.approx(100.0, abs=4.5 * np.sqrt(90.0 / 400))
    assert sizes.var() == pytest.approx(90.0, abs=4.5 * 90.0 * np.sqrt(2.0 / 400))


def test_no_part_is_empty():
    rest = Split(particles=2, phi=0.99, rest=True)
    assert {size(rest, step) for step in range(1, 50)} == {1}


def test_wrong_values():
    with pytest.raises(ConfigError, match="particles"):
        Split(particles=1)
    with pytest.raises(ConfigError, match="phi"):
        Split(phi=0.0)
