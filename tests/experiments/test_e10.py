"""E10: how its claims are decided, and a run."""

import numpy as np
import pytest

from mcloc.experiments import e10_few_samples as e10
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table

MCL_FEW, FEW, MANY = ("MCL", 50), ("mixture", 50), ("mixture", 1000)


def table_of(means: dict[tuple[str, int], float], somewhere: float | None = None) -> Table:
    """Errors around a figure for each filter and size, 0.3 m for others; `somewhere`: those of MCL
    with 50 samples at 10 % noise. The middle of the box is 1 m off.
    """
    rng = np.random.default_rng(0)
    rows = []
    for setting in e10.STUDY.settings():
        key = str(setting["filter"]), int(setting["samples"])
        error = means.get(key, 0.3)
        if somewhere is not None and key == MCL_FEW and setting["noise"] == 0.1:
            error = somewhere
        rows += [
            Row(setting, seed, {"error_m": error * float(np.exp(0.05 * c)), "nothing_m": 1.0})
            for seed, c in enumerate(rng.standard_normal(30))
        ]
    return Table(rows)


@pytest.mark.parametrize(
    ("error", "somewhere", "verdict"),
    [
        (0.8, None, Verdict.REPRODUCED),
        (0.8, 0.2, Verdict.IN_PART),
        (0.49, None, Verdict.NOT),
        (0.2, None, Verdict.NOT),
    ],
)
def test_failing_is_half_of_knowing_nothing(
    error: float, somewhere: float | None, verdict: Verdict
) -> None:
    assert e10.fails(table_of({MCL_FEW: error}, somewhere)).verdict is verdict


@pytest.mark.parametrize(
    ("error", "somewhere", "verdict"),
    [(0.8, None, Verdict.REPRODUCED), (0.8, 0.2, Verdict.IN_PART), (0.2, None, Verdict.NOT)],
)
def test_the_mixture_has_to_be_better(
    error: float, somewhere: float | None, verdict: Verdict
) -> None:
    assert e10.better(table_of({MCL_FEW: error}, somewhere)).verdict is verdict


@pytest.mark.parametrize(
    ("few", "verdict"), [(0.35, Verdict.REPRODUCED), (0.45, Verdict.NOT), (0.9, Verdict.NOT)]
)
def test_slightly_is_less_than_half_as_much_again(few: float, verdict: Verdict) -> None:
    assert e10.slightly(table_of({FEW: few, MANY: 0.3})).verdict is verdict


def test_the_record_of_a_seed_but_for_the_clock() -> None:
    setting = {"moved_mm": 1, "filter": "mixture", "samples": 50, "noise": 0.1}
    one, again = (dict(e10.run(setting, 1)) for _ in range(2))
    assert one.pop("faster") > 0.0 < again.pop("faster")
    assert one == again
    assert one != {**e10.run({**setting, "samples": 1000}, 1), "faster": None}
