"""Numbers of messages: against a set that remembers all."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcloc.team.numbering import REMEMBERED, Numbering


@given(st.lists(st.integers(0, 60)))
def test_duplicates_and_gaps(numbers):
    numbering, seen = Numbering(), set()
    for n in numbers:
        assert numbering.fault(n) == ("duplicate" if n in seen else "")
        seen.add(n)
        assert numbering.missing == max(seen) - min(seen) + 1 - len(seen)
        assert numbering.came == len(seen)


def test_memory_is_bounded():
    numbering = Numbering()
    for n in range(10_000):
        assert numbering.fault(n) == ""
    assert len(numbering._recent) <= 2 * REMEMBERED + 1
    assert numbering.fault(9_999 - REMEMBERED + 1) == "duplicate"
    assert "older" in numbering.fault(9_999 - 3 * REMEMBERED)
    assert numbering.missing == 0


LEAP = 10 * REMEMBERED


def numbered(*numbers):
    numbering = Numbering()
    return numbering, [n for n in numbers if numbering.fault(n) == ""]


def test_a_leap_that_goes_on_is_a_gap():
    numbering, came = numbered(0, 1, LEAP, LEAP + 2)
    assert came == [0, 1, LEAP + 2]
    assert numbering.missing == LEAP
    assert numbering.fault(LEAP) == ""


@pytest.mark.parametrize("forged", [[2**64 - 1], [2**64 - 1] * 3, [LEAP, 2**64 - 1]])
def test_a_number_far_ahead_of_all_others_makes_none_of_them_old(forged):
    numbering, came = numbered(5, 6, *forged, 7, 8, 4)
    assert came == [5, 6, 7, 8, 4]
    assert numbering.fault(2**63) == "numbered far ahead of all others"
    assert numbering.missing == 0


def test_a_first_number_that_is_wrong_makes_none_of_the_others_old():
    numbering, came = numbered(2**64 - 1, 5, 6, 2**64 - 1, 7)
    assert came == [2**64 - 1, 5, 6, 7]
    assert (numbering.came, numbering.missing) == (3, 0)
