"""Tables and figures as text."""

import math

import pytest

from mcloc.evaluation.intervals import Interval
from mcloc.experiments.summary import summarized
from mcloc.experiments.table import Row, Table


@pytest.mark.parametrize(
    ("interval", "text"),
    [
        (Interval(0.1234, 0.1, 0.15), "0.123 (0.100 to 0.150)"),
        (Interval(0.0, 0.0, 0.0), "0.00 (0.00 to 0.00)"),
        (Interval(-12.34, -20.0, 1.5), "-12.3 (-20.0 to 1.50)"),
        (Interval(2000.0, 1000.0, 5000.0), "2,000 (1,000 to 5,000)"),
        (Interval(1.0, -math.inf, math.inf), "1.00 (−∞ to ∞)"),
        (Interval(1e-7, 0.0, math.nan), "1.00e-07 (0.00 to ?)"),
        (Interval(0.9996, 0.99999, 1.0), "1.000 (1.000 to 1.00)"),
    ],
)
def test_three_digits_that_count(interval: Interval, text: str) -> None:
    assert str(interval) == text


def of(values: list[object]) -> Table:
    return Table([Row({}, seed, {"y": value}) for seed, value in enumerate(values)])


def test_what_is_unknown_of_some_runs_is_counted() -> None:
    assert summarized(of([1.0, 1.0, None]), "y") == "1.00 (1.00 to 1.00), 2 of 3 runs"
    assert summarized(of([None]), "y") == "–"
    assert summarized(of([3.0]), "y") == "3.00"


def test_what_is_true_or_false_is_a_share_with_its_exact_interval() -> None:
    assert summarized(of([True] * 10), "y") == "10 of 10, 1.00 (0.692 to 1.00)"


def test_runs_that_raised_are_not_part_of_a_mean() -> None:
    table = Table([Row({}, 0, {"y": 1.0}), Row({}, 1, None, "ValueError: no")])
    assert summarized(table, "y") == "1.00, 1 of 2 runs"
    assert len(table.failed) == 1


def test_pairs_are_seed_by_seed_and_leave_out_what_raised() -> None:
    rows = [Row({"x": x}, seed, {"y": 10.0 * x + seed}) for x in (1, 2) for seed in (2, 0, 1)]
    rows[0] = Row({"x": 1}, 2, None, "ValueError: no")
    one, other = Table(rows).paired("y", {"x": 1}, {"x": 2})
    assert (other - one).tolist() == [10.0, 10.0]
    assert one.tolist() == [10.0, 11.0]
