"""E7: how its claims are decided, and what its runs measure."""

import numpy as np
import pytest

from mcloc.experiments import e07_ceiling_camera as e7
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table
from mcloc.simulation import CeilingTour

GOOD = {
    **{f"spread_{k}": s for k, s in zip(e7.STAGES, (12.0, 8.0, 0.3), strict=True)},
    **{f"best_{k}": s for k, s in zip(e7.STAGES, (0.05, 0.3, 0.97), strict=True)},
    **{f"peaks_{k}": s for k, s in zip(e7.STAGES, (0.0, 4.0, 1.0), strict=True)},
    **{f"error_{k}": s for k, s in zip(e7.STAGES, (9.0, 5.0, 0.2), strict=True)},
}


def table_of(stages=None, lost=None, runs=20):
    """Stages like those of the paper, and the robots lost by (method, machine, metres)."""
    lost = {(e7.GRID, e7.REAL_TIME, e7.SHORT): 1.0} | (lost or {})
    rows = []
    for setting in e7.STUDY.settings():
        key = setting["method"], setting["machine"], setting["metres"]
        for seed in range(runs):
            record = dict.fromkeys(e7.METRICS)
            if setting["method"] == e7.GLOBAL:
                record |= GOOD | (stages or {})
            else:
                gone = seed < lost.get(key, 0.0) * runs
                record |= {"lost": gone, "missed": 0.5, "off": 0.1, "median_m": 1.0}
            rows.append(Row(setting, seed, record))
    return Table(rows)


@pytest.mark.parametrize(
    ("stages", "verdicts"),
    [
        ({}, "RRR"),
        ({"spread_15": 2.0}, "NRR"),
        ({"best_15": 0.8}, "NRR"),
        ({"peaks_38": 0.0}, "RNR"),
        ({"best_38": 0.95}, "RNR"),
        ({"best_126": 0.5}, "RRN"),
        ({"error_126": 10.0}, "RRN"),
    ],
)
def test_stages(stages, verdicts):
    names = {"R": Verdict.REPRODUCED, "N": Verdict.NOT}
    found = [claim.decide(table_of(stages)).verdict for claim in e7.STUDY.claims[:3]]
    assert found == [names[letter] for letter in verdicts]


@pytest.mark.parametrize(
    ("lost", "verdicts"),
    [
        ({}, "RRR"),
        ({(e7.GRID, e7.REAL_TIME, e7.SHORT): 0.0}, "NPR"),
        ({(e7.GRID, e7.REAL_TIME, e7.SHORT): 0.5}, "PRR"),
        ({(e7.GRID, e7.UNLIMITED, e7.SHORT): 1.0}, "RNR"),
        ({(e7.MCL, e7.REAL_TIME, e7.LONG): 1.0}, "RRP"),
        ({(e7.MCL, e7.REAL_TIME, m): 1.0 for m in (e7.SHORT, e7.LONG)}, "RRN"),
    ],
)
def test_real_time(lost, verdicts):
    names = {"R": Verdict.REPRODUCED, "P": Verdict.IN_PART, "N": Verdict.NOT}
    found = [claim.decide(table_of(lost=lost)).verdict for claim in e7.STUDY.claims[3:]]
    assert found == [names[letter] for letter in verdicts]


def test_a_global_run_looks_at_its_stages(monkeypatch):
    e7.museum_drive.cache_clear()
    setting = {"method": e7.GLOBAL, "machine": e7.UNLIMITED, "metres": e7.SHORT}
    monkeypatch.setattr(e7, "MEAN_SPEED", 2.0)  # 50 s
    one, again = (e7.run(setting, 1) for _ in range(2))
    assert one == again
    assert one["spread_15"] >= 0.0
    assert all(0.0 < one[f"best_{k}"] <= 1.0 for k in e7.STAGES)
    assert one["lost"] is None
    assert set(one) == set(e7.METRICS)


def test_images_are_lost_while_a_slow_filter_is_busy(monkeypatch):
    e7.museum_drive.cache_clear()
    monkeypatch.setattr(e7, "MEAN_SPEED", 5.0)  # 20 s
    setting = {"method": e7.MCL, "machine": e7.REAL_TIME, "metres": e7.SHORT}
    quick = e7.run(setting, 0)
    monkeypatch.setattr(e7, "POSE_IMAGE", 1e-3)
    slow = e7.run(setting, 0)
    assert quick["missed"] == 0.0
    assert slow["missed"] > 0.5
    assert 10.0 < quick["driven_m"] < 33.0
    assert not quick["lost"]
    e7.museum_drive.cache_clear()


def test_tours_of_one_seed_are_made_once():
    e7.museum_drive.cache_clear()
    tour = CeilingTour(5.0)
    assert e7.museum_drive(0, tour) is e7.museum_drive(0, CeilingTour(5.0))
    assert np.isfinite(e7.museum_drive(0, tour).distance)
