"""E1: how its claims are decided, and its figures against what mathematics says."""

import math
from functools import reduce
from pathlib import Path

import numpy as np
import pytest

from mcloc.experiments import e01_motion_density as e01
from mcloc.experiments.results import draw
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table
from mcloc.geometry import compose

SETTING = {"step": 1.0, "noise": 1.0}


def table_of(records: list[dict[str, float]], grown: list[float]) -> Table:
    """Twenty seeds of mcloc's noise for each record, one for each step; `grown`: of the path."""
    rng = np.random.default_rng(0)
    rows = []
    for step, record in zip(e01.STEPS, records, strict=True):
        for seed in range(20):
            about = {name: value + 0.01 * rng.standard_normal() for name, value in record.items()}
            sets = {"spreads_m": grown, "areas_m2": grown, "bend_gaussian": 0.01}
            rows.append(Row({"step": step, "noise": 1.0}, seed, {**about, **sets}))
    return Table(rows)


BANANA = {"bend_40": -0.9, "bend_80": -0.8, "across_40_m": 6.0, "across_80_m": 17.0}
BLOB = {"bend_40": 0.0, "bend_80": -0.1, "across_40_m": 6.0, "across_80_m": 6.0}
GROWING, SHRINKING = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [6.0, 5.0, 4.0, 3.0, 2.0, 1.0]


@pytest.mark.parametrize(
    ("records", "verdict"),
    [
        ([BANANA, BANANA], Verdict.REPRODUCED),
        ([BANANA, BLOB], Verdict.IN_PART),
        ([BLOB, BLOB], Verdict.NOT),
    ],
)
def test_verdicts_on_densities(records: list[dict[str, float]], verdict: Verdict) -> None:
    table = table_of(records, GROWING)
    assert e01.bananas(table).verdict is verdict
    assert e01.widen(table).verdict is verdict


@pytest.mark.parametrize(
    ("grown", "verdict"),
    [
        (GROWING, Verdict.REPRODUCED),
        ([1.0, 2.0, 3.0, 2.0, 5.0, 6.0], Verdict.IN_PART),
        (SHRINKING, Verdict.NOT),
    ],
)
def test_verdicts_on_the_path(grown: list[float], verdict: Verdict) -> None:
    assert e01.spreading(table_of([BANANA, BANANA], grown)).verdict is verdict


def test_other_noise_is_told_and_decides_nothing() -> None:
    table = table_of([BANANA, BANANA], GROWING)
    loud = [
        Row({**r.setting, "noise": 2.0}, r.seed, {**(r.record or {}), **BLOB}) for r in table.rows
    ]
    finding = e01.bananas(Table([*table.rows, *loud]))
    assert finding.verdict is Verdict.REPRODUCED
    assert "4 of 8" in finding.note


@pytest.mark.parametrize("step", e01.STEPS)
@pytest.mark.parametrize("noise", e01.NOISES)
def test_the_closed_form_agrees_with_the_samples(step: float, noise: float) -> None:
    motion = e01.model(noise)
    (x,) = e01.sample_sets(e01.straight(20.0, step), motion, 3, (20.0,))
    expected = e01.predicted_across(20.0, step, motion)
    # A standard deviation of 10,000 samples errs by 0.7 %.
    assert x[1].std() == pytest.approx(expected, rel=0.03)


def test_the_closed_form_for_small_angles() -> None:
    """Across is Σ_k d θ_k, θ the sum of 2k − 1 errors: d s √(2n³/3) for many steps."""
    motion, n = e01.model(0.05), 400
    s = motion.decompose(np.array([0.1, 0.0, 0.0])).sd_rot1
    expected = 0.1 * s * math.sqrt(2.0 * n**3 / 3.0)
    assert e01.predicted_across(40.0, 0.1, motion) == pytest.approx(expected, rel=0.01)


def test_bend_of_a_parabola_and_of_a_gaussian() -> None:
    x = np.random.default_rng(0).standard_normal((3, e01.SAMPLES))
    assert abs(e01.bend(x)) < 5.0 / math.sqrt(e01.SAMPLES)
    x[1] -= x[1].mean()
    x[0] = -0.1 * x[1] ** 2
    assert e01.bend(x) == pytest.approx(-1.0)


def test_bend_of_a_random_walk_in_heading() -> None:
    """Corr(∫B², (∫B)²) = (4/15) / √(1/3 · 2/9) = 0.98 for a Brownian heading."""
    rng = np.random.default_rng(1)
    heading = 1e-3 * np.cumsum(rng.standard_normal((500, 4000)), axis=0)
    x = np.stack([np.cos(heading).sum(axis=0), np.sin(heading).sum(axis=0)])
    assert e01.bend(x) == pytest.approx(-(4 / 15) / math.sqrt(2 / 27), abs=0.01)


def test_spread_and_area() -> None:
    x = np.array([[-3.0, 3.0, -3.0, 3.0], [-4.0, -4.0, 4.0, 4.0], [0.0, 0.0, 0.0, 0.0]])
    assert e01.spread(x) == pytest.approx(5.0)
    assert e01.area(x) == pytest.approx(12.0 * 4 / 3)


@pytest.mark.parametrize("step", e01.STEPS)
def test_the_path_without_noise(step: float) -> None:
    end = reduce(compose, e01.path(step), np.zeros(3))
    np.testing.assert_allclose(end[:2], [-15.0, 15.0], atol=1e-9)
    assert abs(end[2]) == pytest.approx(np.pi)


def test_a_seed_gives_the_same_record_and_a_picture(tmp_path: Path) -> None:
    record = e01.run(SETTING, 1)
    assert record == e01.run(SETTING, 1)
    assert record != e01.run(SETTING, 2)
    assert len(record["spreads_m"]) == len(e01.STOPS)
    draw(e01.STUDY, Table([Row(SETTING, 1, record)]), tmp_path / "figure.png")
