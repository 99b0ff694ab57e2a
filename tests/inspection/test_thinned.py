"""Thinned: few items, evenly spread over a stream whose length nobody knows."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mcloc.inspection.thinned import Thinned


@given(st.integers(0, 500), st.integers(2, 40))
def test_keeps_few_items_evenly_spread(n: int, most: int) -> None:
    thinned: Thinned[int] = Thinned(most)
    for item in range(n):
        thinned.add(item)
    kept = list(thinned)
    assert len(kept) == len(thinned) <= most
    assert len(kept) >= min(n, most / 2)
    assert thinned.seen == n
    if n:
        assert kept[0] == 0
        step = kept[1] if len(kept) > 1 else n
        assert kept == list(range(0, n, step))
        assert len(np.unique(np.diff(kept))) <= 1
