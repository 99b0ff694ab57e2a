"""E5: how its claims are decided, and that the machine of 1999 is the paper's."""

import numpy as np
import pytest

from mcloc.experiments import e05_sample_size as e05
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table
from mcloc.localizer.pace import Modelled

PLACES = (e05.OFFICE, "wean-1")


def table_of(curves: dict[str, list[float]], seeds: int = 20) -> Table:
    """Errors around a curve over e05.SIZES for each place."""
    rng = np.random.default_rng(0)
    rows = []
    for place, curve in curves.items():
        for size, error in zip(e05.SIZES, curve, strict=True):
            setting = {"place": place, "pace": "1999", "scans": "all", "samples": size}
            rows += [
                Row(setting, seed, {"error_m": error * float(np.exp(0.02 * noise))})
                for seed, noise in enumerate(rng.standard_normal(seeds))
            ]
    return Table(rows)


U = [0.3, 0.25, 0.2, 0.15, 0.12, 0.1, 0.12, 0.15, 0.2, 0.3]  # best with 2,000
FALLING = [0.3, 0.25, 0.2, 0.15, 0.12, 0.1, 0.09, 0.08, 0.07, 0.05]
EARLY = [0.3, 0.2, 0.1, 0.12, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4]  # best with 100


@pytest.mark.parametrize(
    ("curves", "shape", "optimum"),
    [
        ((U, U), Verdict.REPRODUCED, Verdict.REPRODUCED),
        ((FALLING, FALLING), Verdict.NOT, Verdict.NOT),
        ((EARLY, EARLY), Verdict.REPRODUCED, Verdict.NOT),
        ((U, FALLING), Verdict.IN_PART, Verdict.IN_PART),
        ((EARLY, U), Verdict.REPRODUCED, Verdict.IN_PART),
    ],
)
def test_verdicts_follow_the_curves(
    curves: tuple[list[float], ...], shape: Verdict, optimum: Verdict
) -> None:
    table = table_of(dict(zip(PLACES, curves, strict=True)))
    assert e05.u_shape(table).verdict is shape
    assert e05.optimum(table).verdict is optimum


def test_the_optimum_has_an_interval() -> None:
    found = e05.optimum(table_of({e05.OFFICE: U})).figure
    assert (found.low, found.value, found.high) == (2000.0, 2000.0, 2000.0)
    flat = [*U[:4], 0.1, 0.1, 0.1, *U[7:]]
    found = e05.optimum(table_of({e05.OFFICE: flat})).figure
    assert (found.low, found.high) == (1000.0, 5000.0)


def test_the_modelled_machine_is_that_of_the_papers() -> None:
    """Losses begin above 1,000 samples at 5 Hz, and 5,000 take less than 3 s for a scan."""
    beams, interval = 60, 0.2
    of_one = Modelled().particle_beam * beams
    assert 1000 * of_one <= interval < 2000 * of_one
    assert 5000 * of_one < 3.0


def test_losses_begin_above_1000_samples() -> None:
    def used(samples: int) -> float:
        setting = {"place": e05.OFFICE, "pace": "1999", "scans": "all", "samples": samples}
        return float(e05.run(setting, 3)["used"])

    assert used(1000) == 1.0
    assert used(2000) == pytest.approx(0.5, abs=0.01)


def test_a_seed_gives_the_same_record() -> None:
    setting = {"place": e05.OFFICE, "pace": "1999", "scans": "all", "samples": 300}
    assert e05.run(setting, 1) == e05.run(setting, 1)
    assert e05.run(setting, 1) != e05.run(setting, 2)


def test_settings_leave_out_what_is_not_asked() -> None:
    settings = e05.STUDY.settings()
    assert len(settings) == 5 * len(e05.SIZES)
    assert not any(s["pace"] == "offline" and s["place"] != e05.OFFICE for s in settings)
