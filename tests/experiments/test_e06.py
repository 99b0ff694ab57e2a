"""E6: how its claims are decided, and that both representations are measured in the same way."""

import numpy as np
import pytest

from mcloc.experiments import e06_grid_cost as e06
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table
from mcloc.filters.catalog import Composition


def table_of(**ratios: tuple[float, float]) -> Table:
    """Ratios in two places."""
    rng = np.random.default_rng(0)
    rows = []
    for nth, place in enumerate((e06.OFFICE, "intel")):
        for seed in range(10):
            record = {
                f"{what}_ratio": values[nth] * float(np.exp(0.05 * rng.standard_normal()))
                for what, values in ratios.items()
            }
            rows.append(Row({"place": place}, seed, record))
    return Table(rows)


@pytest.mark.parametrize(
    ("ratios", "verdict"),
    [
        ((10.0, 9.0), Verdict.REPRODUCED),
        ((10.0, 100.0), Verdict.IN_PART),
        ((1.0, 100.0), Verdict.NOT),
    ],
)
def test_ten_times_the_memory(ratios, verdict):
    assert e06.ten_times(table_of(memory=ratios)).verdict is verdict


@pytest.mark.parametrize(
    ("ratios", "verdict"),
    [
        ((60.0, 400.0), Verdict.REPRODUCED),
        ((30.0, 400.0), Verdict.IN_PART),
        ((3.0, 4.0), Verdict.NOT),
    ],
)
def test_forty_times_the_time(ratios, verdict):
    assert e06.forty_times(table_of(**{"global": ratios})).verdict is verdict


@pytest.mark.parametrize(
    ("ratios", "verdict"),
    [
        ((1.0, 1.5), Verdict.REPRODUCED),
        ((1.0, 5.0), Verdict.IN_PART),
        ((0.1, 5.0), Verdict.NOT),
    ],
)
def test_equally_fast(ratios, verdict):
    assert e06.equally_fast(table_of(localized=ratios)).verdict is verdict


def test_a_run_measures_both():
    record = e06.run({"place": e06.OFFICE}, 0)
    assert record["MCL_memory_mb"] == pytest.approx(32e-6 * e06.SAMPLES)
    driven = e06.drive(e06.OFFICE, 0, e06.LENGTH)
    lattice = Composition("markov-grid").build(driven.grid).lattice
    assert lattice.cell == e06.CELL
    assert record["grid_memory_mb"] == pytest.approx(4e-6 * lattice.size, rel=1e-3)
    assert record["grid_global_ms"] > record["MCL_global_ms"] > 0.0
    for what in ("memory_mb", "global_ms", "localized_ms"):
        ratio = record[f"grid_{what}"] / record[f"MCL_{what}"]
        assert record[f"{what.split('_')[0]}_ratio"] == pytest.approx(ratio)
