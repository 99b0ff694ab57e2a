"""E9: how its claims are decided, and a run of each kind."""

import numpy as np
import pytest

from mcloc.experiments import e09_mixture_proposal as e09
from mcloc.experiments.object_in_space import FILTERS, NOISES
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table

RISING = np.array([0.05, 0.1, 0.2, 0.3, 0.5, 0.9])
U = np.array([0.9, 0.5, 0.3, 0.35, 0.6, 1.2])


def table_of(zeros: float = 0.9, spread: float = 0.02, **curves: np.ndarray) -> Table:
    """Errors around a curve over NOISES for each filter, by its first letters; those of others
    around a curve that rises.
    """
    rng = np.random.default_rng(0)
    rows = []
    for setting in e09.STUDY.settings():
        name = str(setting["filter"])
        curve = curves.get(name.partition(",")[0], RISING)
        curve = curves.get("forward", curve) if name == e09.FORWARD else curve
        error = float(curve[NOISES.index(float(setting["noise"]))])
        rows += [
            Row(
                setting,
                seed,
                {"error_m": error * float(np.exp(spread * chance)), "zeros": zeros + 0.01 * chance},
            )
            for seed, chance in enumerate(rng.standard_normal(30))
        ]
    return Table(rows)


@pytest.mark.parametrize(
    ("mcl", "spread", "better", "tenfold"),
    [
        (U, 0.02, Verdict.REPRODUCED, Verdict.REPRODUCED),  # 18 times at 1 %
        (1.1 * RISING, 0.02, Verdict.REPRODUCED, Verdict.NOT),
        (0.9 * RISING, 0.02, Verdict.NOT, Verdict.NOT),
        (np.array([0.6, 0.1, 0.1, 0.1, 0.1, 0.1]), 0.5, Verdict.IN_PART, Verdict.IN_PART),
    ],
)
def test_the_mixture_against_mcl(
    mcl: np.ndarray, spread: float, better: Verdict, tenfold: Verdict
) -> None:
    table = table_of(MCL=mcl, spread=spread)
    assert e09.better(table).verdict is better
    assert e09.tenfold(table).verdict is tenfold


@pytest.mark.parametrize(
    ("curve", "verdict"),
    [
        (RISING, Verdict.REPRODUCED),
        (np.array([0.1, 0.1, 0.2, 0.3, 0.5, 0.9]), Verdict.IN_PART),
        (U, Verdict.NOT),
        (np.full(6, 0.3), Verdict.NOT),
    ],
)
def test_monotone_is_what_rises_with_each_noise(curve: np.ndarray, verdict: Verdict) -> None:
    assert e09.mixture_rises(table_of(mixture=curve)).verdict is verdict


@pytest.mark.parametrize(
    ("dual", "verdict"),
    [
        (2.0 * RISING, Verdict.REPRODUCED),
        (2.0 * U, Verdict.IN_PART),  # worse, but not monotone
        (0.5 * RISING, Verdict.IN_PART),  # monotone, but better
        (np.full(6, 0.3), Verdict.NOT),
    ],
)
def test_the_dual_alone_has_to_be_monotone_and_worse(dual: np.ndarray, verdict: Verdict) -> None:
    assert e09.dual_alone(table_of(dual=dual)).verdict is verdict


@pytest.mark.parametrize(
    ("forward", "spread", "verdict"),
    [
        (RISING, 0.02, Verdict.REPRODUCED),
        (2.0 * RISING, 0.02, Verdict.NOT),
        (0.5 * RISING, 0.02, Verdict.NOT),
        (1.2 * RISING, 1.0, Verdict.IN_PART),  # too uncertain to tell
    ],
)
def test_approach_2_has_to_be_as_good(forward: np.ndarray, spread: float, verdict: Verdict) -> None:
    assert e09.approaches(table_of(forward=forward, spread=spread)).verdict is verdict


@pytest.mark.parametrize(("zeros", "verdict"), [(0.9, Verdict.REPRODUCED), (0.4, Verdict.NOT)])
def test_most_weights_are_more_than_half(zeros: float, verdict: Verdict) -> None:
    assert e09.zero_weights(table_of(zeros)).verdict is verdict


def test_approach_1_is_tried_with_one_kind_of_wheels() -> None:
    settings = e09.STUDY.settings()
    assert len(settings) == len(NOISES) * (2 * len(FILTERS) - 1)
    assert {s["moved_mm"] for s in settings if s["filter"] == e09.PAIRS} == {1}


def test_the_record_of_a_seed_but_for_the_clock() -> None:
    setting = {"moved_mm": 1, "filter": e09.PAIRS, "noise": 0.1}
    one, again = (dict(e09.run(setting, 1)) for _ in range(2))
    assert one.pop("faster") > 0.0 < again.pop("faster")
    assert one == again
    assert 0.9 < one["zeros"] <= 1.0
    assert e09.run({**setting, "filter": "MCL"}, 1)["zeros"] is None
