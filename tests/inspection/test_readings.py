"""Readings: counts by kind, and faults of limits and units, planted in plausible readings."""

from dataclasses import replace

import numpy as np
import pytest

from mcloc.events import Scan
from mcloc.inspection.finding import Finding
from mcloc.inspection.readings import Readings, inspect_readings

ANGLES = np.linspace(-np.pi / 2, np.pi / 2, 181)


def scans(n: int = 100, seed: int = 1) -> list[Scan]:
    """Ranges as indoors: half within 2 m, few beyond 10 m; 2 % missing."""
    rng = np.random.default_rng(seed)
    r = np.maximum(rng.lognormal(np.log(2.0), 0.7, (n, 181)), 0.1)
    r[rng.random(r.shape) < 0.02] = np.inf
    return [Scan(float(t), row, ANGLES, 30.0) for t, row in enumerate(r)]


def readings_of(some: list[Scan]) -> Readings:
    readings = Readings()
    for scan in some:
        readings.add(scan)
    return readings


def found(some: list[Scan]) -> list[Finding]:
    return inspect_readings("laser", readings_of(some))


def changed(change: object, **fields: float) -> list[Scan]:
    return [replace(s, ranges=change(s.ranges), **fields) for s in scans()]  # type: ignore


def test_counts_against_numpy() -> None:
    rng = np.random.default_rng(2)
    r = rng.uniform(0.0, 8.0, 1000)
    r[:50], r[50:150], r[150:170], r[170:200] = np.nan, np.inf, 0.0, -1.0
    scan = Scan(0.0, r, np.zeros(1000), range_max=6.0, range_min=0.5)
    readings = readings_of([scan, scan])
    returned = r[200:][(r[200:] >= 0.5) & (r[200:] < 6.0)]
    assert readings.kinds == {
        "NaN": 100,
        "infinite": 200,
        "0 or less": 100,
        "below range_min": 2 * (r[200:] < 0.5).sum(),
        "at or beyond range_max": 2 * (r[200:] >= 6.0).sum(),
    }
    assert readings.total == 2000
    assert readings.returns == 2 * len(returned)
    assert readings.missing == pytest.approx(1.0 - len(returned) / 1000)
    assert readings.median == pytest.approx(np.median(returned), rel=0.024)


def test_plausible_readings_are_right() -> None:
    for seed in range(10):
        assert found(scans(seed=seed)) == []
    assert found([]) == []


@pytest.mark.parametrize("code", [np.nan, np.inf, 81.83, 0.0])
def test_missing_returns_are_told_by_kind(code: float) -> None:
    def lose(r: np.ndarray) -> np.ndarray:
        return np.where(np.arange(181) % 5 < 2, code, r)

    (finding,) = found(changed(lose))
    assert finding.check == "returns-missing"
    assert "41 %" in finding.what or "42 %" in finding.what
    kind = {81.83: "at or beyond range_max", 0.0: "0 or less", np.inf: "infinite"}.get(code, "NaN")
    assert kind in finding.evidence
    assert found(changed(lambda r: np.where(np.arange(181) % 5 < 1, code, r))) == []


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "millimetres"), (1e2, "centimetres")])
@pytest.mark.parametrize("limit", [30.0, 1.0])
def test_ranges_in_another_unit(factor: float, unit: str, limit: float) -> None:
    """With the limit in metres, and in the same unit as the ranges."""
    range_max = 30.0 if limit == 30.0 else 30.0 * factor
    (finding,) = found(changed(lambda r: r * factor, range_max=range_max))
    assert finding.check == "ranges-unit"
    assert unit in finding.what
    assert f"by {1 / factor:g}" in finding.remedy


def test_ranges_that_are_far_too_short() -> None:
    (finding,) = found(changed(lambda r: r / 1e3))
    assert finding.check == "ranges-unit"


def test_range_max_below_what_is_measured() -> None:
    (finding,) = found(changed(lambda r: r, range_max=3.0))
    assert finding.check == "range-max-low"
    assert "3 m" in finding.what


def test_range_min_above_what_is_measured() -> None:
    (finding,) = found(changed(lambda r: r, range_min=2.0))
    assert finding.check == "range-min-high"
    assert "2 m" in finding.what


def test_readings_cut_below_range_max() -> None:
    (finding,) = found(changed(lambda r: np.minimum(r, 4.0)))
    assert finding.check == "ranges-cut"
    assert "4.00 m" in finding.what
    missing = changed(lambda r: np.where(np.isinf(r), 7.99, r), range_max=8.0)
    assert [f.check for f in found(missing)] == ["ranges-cut"]
    assert found(changed(lambda r: np.minimum(r, 4.0), range_max=4.0)) == []
