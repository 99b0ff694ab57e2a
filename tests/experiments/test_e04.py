"""E4: how its claims are decided, and that its runs measure what they say."""

import numpy as np
import pytest

from mcloc.experiments import e04_grid_resolution as e04
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table


def table_of(
    laser: list[float],
    sonar: list[float],
    busy: list[float] = (1.6, 0.15, 0.1, 0.05, 0.01),
    mcl: float = 0.04,
) -> Table:
    """Errors around those of each size of cells."""
    rng = np.random.default_rng(0)
    rows = []
    for sensor, errors in (("laser", laser), ("sonar", sonar)):
        of_cells = [*zip(e04.CELLS, errors, busy, strict=True), (0, mcl, 0.1)]
        for cell, error, seconds in of_cells:
            name = e04.GRID if cell else e04.MCL
            setting = {"sensor": sensor, "filter": name, "cell": cell, "degrees": 4}
            rows += [
                Row(setting, seed, {"error_m": error * float(np.exp(0.03 * e)), "busy_s": seconds})
                for seed, e in enumerate(rng.standard_normal(20))
            ]
    return Table(rows)


GROWS = [0.04, 0.06, 0.1, 0.2, 0.4]
HIGHER = [0.08, 0.12, 0.2, 0.4, 0.8]
FLAT = [0.04] * 5
BENT = [0.04, 0.06, 0.05, 0.2, 0.4]


@pytest.mark.parametrize(
    ("laser", "sonar", "grows", "laser_better"),
    [
        (GROWS, HIGHER, Verdict.REPRODUCED, Verdict.REPRODUCED),
        (HIGHER, GROWS, Verdict.REPRODUCED, Verdict.NOT),
        (FLAT, FLAT, Verdict.NOT, Verdict.NOT),
        (GROWS, FLAT, Verdict.IN_PART, Verdict.NOT),
        (BENT, HIGHER, Verdict.IN_PART, Verdict.REPRODUCED),
        (FLAT, GROWS, Verdict.IN_PART, Verdict.IN_PART),
    ],
)
def test_verdicts_follow_the_curves(laser, sonar, grows, laser_better):
    table = table_of(laser, sonar)
    assert e04.grows(table).verdict is grows
    assert e04.laser_better(table).verdict is laser_better


@pytest.mark.parametrize(
    ("busy", "verdict"),
    [
        ([1.6, 0.15, 0.1, 0.05, 0.01], Verdict.REPRODUCED),
        ([1.6, 0.4, 0.1, 0.05, 0.01], Verdict.IN_PART),
        ([0.1, 0.05, 0.03, 0.02, 0.01], Verdict.NOT),
    ],
)
def test_what_misses_real_time(busy, verdict):
    assert e04.real_time(table_of(GROWS, HIGHER, busy)).verdict is verdict


@pytest.mark.parametrize(
    ("mcl", "verdict"),
    [(0.041, Verdict.REPRODUCED), (0.01, Verdict.IN_PART), (0.5, Verdict.IN_PART)],
)
def test_which_cells_match_mcl(mcl, verdict):
    assert e04.needs_four(table_of(GROWS, HIGHER, mcl=mcl)).verdict is verdict


def test_a_run_tells_its_error_and_its_cells():
    setting = {"sensor": "laser", "filter": e04.GRID, "cell": 32, "degrees": 4}
    coarse = e04.run(setting, 0)
    assert coarse == e04.run(setting, 0)
    samples = e04.run({**setting, "filter": e04.MCL, "cell": 0}, 0)
    assert 0.0 < samples["error_m"] < coarse["error_m"] < 0.5
    assert samples["states"] == e04.SAMPLES
    assert samples["busy_s"] == pytest.approx(3.3e-6 * e04.SAMPLES * 60)
    assert 1 <= coarse["states"] < 1000
    assert coarse["busy_s"] == pytest.approx(3.3e-6 * coarse["states"] * 60, rel=0.05)


def test_only_the_grid_has_cells():
    settings = e04.STUDY.settings()
    assert len(settings) == len(e04.SENSORS) * (len(e04.CELLS) + 3 + 1)
    assert all((s["filter"] == e04.MCL) == (s["cell"] == 0) for s in settings)


def test_both_sensors_drive_the_same_way():
    laser, sonar = e04.driven("laser", 1), e04.driven("sonar", 1)
    np.testing.assert_array_equal(laser.truth.poses, sonar.truth.poses)
    assert laser.grid.checksum == sonar.grid.checksum
