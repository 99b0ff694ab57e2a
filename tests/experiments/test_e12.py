"""E12: how its claims are decided, when a robot is found, and what its runs measure."""

import numpy as np
import pytest

from mcloc.experiments import e12_ceiling_kidnapped as e12
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table


def table_of(found, wait=20.0, lost=None, before=0.0, runs=100):
    """found: share of the robots by method; lost: share of the time, around which runs scatter."""
    rng = np.random.default_rng(0)
    lost = {e12.MCL: 1.0, e12.MIXTURE: 0.3, e12.RANDOM: 0.6} | (lost or {})
    rows = []
    for setting in e12.STUDY.settings():
        method = setting["method"]
        for seed in range(runs):
            if setting["seconds"] == e12.LONG and seed >= e12.FEW:
                rows.append(Row(setting, seed, dict.fromkeys(e12.METRICS)))
                continue
            again = seed < found.get(method, 0.0) * runs
            record = {
                "before": before,
                "lost": lost[method] + 0.05 * rng.standard_normal(),
                "found": again,
                "wait_s": wait if again else None,
                "median_m": 0.2,
                "images": 2074,
                "curve_m": [0.0, 1.0],
            }
            rows.append(Row(setting, seed, record))
    return Table(rows)


MOST = {e12.MIXTURE: 0.9, e12.RANDOM: 0.5}


@pytest.mark.parametrize(
    ("options", "verdicts"),
    [
        ({"found": MOST}, "RRR"),
        ({"found": MOST | {e12.MCL: 0.2}}, "PRR"),
        ({"found": MOST | {e12.MCL: 0.6}}, "NRR"),
        ({"found": MOST, "wait": 90.0}, "RPR"),
        ({"found": {e12.MIXTURE: 0.4}}, "RNR"),
        ({"found": MOST, "lost": {e12.RANDOM: 0.3}}, "RRP"),
        ({"found": MOST, "lost": {e12.RANDOM: 0.3, e12.MCL: 0.3}}, "RRN"),
    ],
)
def test_verdicts(options, verdicts):
    names = {"R": Verdict.REPRODUCED, "P": Verdict.IN_PART, "N": Verdict.NOT}
    found = [claim.decide(table_of(**options)).verdict for claim in e12.STUDY.claims]
    assert found == [names[letter] for letter in verdicts]


def test_robots_that_were_lost_before_do_not_count():
    share = e12.found_share(table_of(MOST, before=0.9), e12.MIXTURE)
    assert np.isnan(share.value)
    for claim in e12.STUDY.claims[:2]:
        assert claim.decide(table_of(MOST, before=0.9)).verdict is Verdict.NOT


def test_a_robot_is_found_where_the_estimate_stays_near_it():
    t = np.arange(0.0, 200.0)
    off = (t > 50) & (t < 90) | (t > 100) & (t < 130)
    assert e12.waited(t, off, 50.0) == 80.0  # for 10 s it was near by chance
    assert e12.waited(t, off & (t < 100), 50.0) == 40.0
    assert e12.waited(t, t > 50, 50.0) == np.inf
    assert e12.waited(t, (t > 50) & (t < 190), 50.0) == np.inf  # nobody knows for how long
    assert e12.waited(t, np.zeros(200, dtype=bool), 50.0) == 1.0


def test_a_run_loses_the_robot_and_a_seed_gives_the_same(monkeypatch):
    monkeypatch.setattr(e12, "SHORT", 60)
    e12.museum_drive.cache_clear()
    setting = {"method": e12.MCL, "seconds": 60}
    one, again = (e12.run(setting, 3) for _ in range(2))
    assert one == again
    assert one["before"] < 0.2
    assert one["lost"] > 0.5
    assert one["images"] == round(60 * 5.185)
    assert set(one) == set(e12.METRICS)
    e12.museum_drive.cache_clear()


def test_long_drives_are_made_for_a_few_seeds():
    record = e12.run({"method": e12.MCL, "seconds": e12.LONG}, e12.FEW)
    assert set(record.values()) == {None}


@pytest.mark.parametrize("method", e12.METHODS)
def test_all_methods_have_the_same_number_of_samples(method):
    drive = e12.museum_drive(0, e12.CeilingTour(5.0))
    built = e12.composition(method).build(drive.grid, drive.mosaic)
    (part,) = built.parts
    assert part.size.fixed == e12.SAMPLES
    assert built.recovery.doubt_below == (0.75 if method == e12.MIXTURE else 0.0)
