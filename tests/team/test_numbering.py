"""Numbers of messages: against a set that remembers all."""

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


def test_a_leap_is_a_gap():
    numbering = Numbering()
    numbering.fault(0)
    numbering.fault(2**64 - 1)
    assert numbering.missing == 2**64 - 2
