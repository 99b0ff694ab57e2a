"""Decades: medians and heaps, against NumPy."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcloc.inspection.decades import Decades


def counted(values: list[float]) -> Decades:
    decades = Decades()
    decades.add(np.array(values))
    return decades


@given(st.lists(st.floats(1e-5, 1e10), min_size=1, max_size=51).filter(lambda v: len(v) % 2 == 1))
def test_median(values: list[float]) -> None:
    decades = counted(values)
    assert decades.total == len(values)
    assert decades.median == pytest.approx(np.median(values), rel=0.024)


def test_of_nothing() -> None:
    assert (Decades().total, Decades().alike) == (0, 0)
    assert math.isnan(Decades().median)


def test_what_is_too_small_or_large_counts_at_the_ends() -> None:
    decades = counted([1e-9, 1e-8, 1e20])
    assert decades.total == 3
    assert decades.median < 1.1e-6


def test_codes_are_alike_and_distances_are_not() -> None:
    assert counted([81.83, 81.87, 81.91, 60.0]).alike == 3
    assert counted([51.05, 51.10] * 5).alike == 10
    assert counted(list(np.geomspace(1.0, 30.0, 100))).alike < 10
