"""Places far from each other."""

import numpy as np

from mcloc.simulation.spread import spread


def test_each_place_is_the_farthest_from_those_before() -> None:
    places = np.random.default_rng(1).uniform(0.0, 10.0, (60, 2))
    chosen = spread(places, 7)
    assert chosen[0] == 0
    assert len(set(chosen)) == 7
    for k in range(1, 7):
        before = places[chosen[:k]]
        away = np.array([min(np.hypot(*(place - one)) for one in before) for place in places])
        assert away[chosen[k]] == away.max()
    assert spread(places, 1) == [0]
